#!/usr/bin/env bash
# Checks a GPU against the CPU, then times both at the paper's size: training steps of 32 snippets
# of 256 x 256 (a step of the paper), and extraction of the example's 480 frames. Prints a table.
#
#     tools/gpu/bench.sh [--steps N] [--snippets N]
#
# It needs Rust, a driver for Vulkan, Metal or Direct3D 12, and python3. Without a card, Mesa's
# lavapipe serves to try it (`cargo xtask test --with gpu` installs that), with `--steps 1
# --snippets 1`.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

steps=7
snippets=32
while (($#)); do
    case "$1" in
        --steps) steps="$2" ;;
        --snippets) snippets="$2" ;;
        *)
            echo "error: unknown option $1; expected --steps N or --snippets N" >&2
            exit 2
            ;;
    esac
    shift 2
done

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
tracklens=(cargo run --quiet --release --package=tracklens --features=gpu --)
bench=(cargo bench --quiet --package=tracklens --features=gpu)

cargo build --release --package=tracklens --features=gpu
cargo test --release --package=tracklens --features=gpu --test=training gpu:: -- --nocapture \
    >"$work/parity" || {
    cat "$work/parity"
    exit 1
}
"${bench[@]}" --bench=extract -- --checkpoints "$work" >&2

# Milliseconds of a training step: architecture, device.
step() {
    "${bench[@]}" --bench=train_step -- --json "$1" --device "$2" --input 256 \
        --snippets "$snippets" --steps "$steps" |
        python3 -c 'import json, sys; print(json.load(sys.stdin)["median_ms"])'
}

# Milliseconds a frame, reading included: encoder, device.
extraction() {
    local start end frames
    frames="$(find web/example/frames -name '*.png' | wc -l)"
    start="$(python3 -c 'import time; print(time.monotonic())')"
    "${tracklens[@]}" extract --quiet --checkpoint "$work/$1.safetensors" \
        --frames web/example/frames --out "$work/$1-$2.csv" --device "$2" >&2
    end="$(python3 -c 'import time; print(time.monotonic())')"
    python3 -c "print(1e3 * ($end - $start) / $frames)"
}

# A row of the table: what, on the CPU, on the GPU.
row() {
    python3 -c "print(f'| $1 | {$2:.1f} | {$3:.1f} | {$2 / $3:.2f} |')"
}

{
    echo "| ms | CPU | GPU | CPU / GPU |"
    echo "|---|---|---|---|"
    for architecture in basic keynet-vel-std-bg; do
        row "training step, $architecture" "$(step "$architecture" cpu)" "$(step "$architecture" gpu)"
    done
    for encoder in basic keynet; do
        row "frame, $encoder" "$(extraction "$encoder" cpu)" "$(extraction "$encoder" gpu)"
    done
} >"$work/table"
grep -m 1 -i 'vulkan\|metal\|dx12\|gl' "$work/parity" || true
echo "GPU and CPU agree (cargo test --features gpu --test training gpu::)."
cat "$work/table"
