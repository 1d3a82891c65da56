//! The `tracklens` command.

#[global_allocator]
static MEMORY: tracklens::cli::Memory = tracklens::cli::Memory;

fn main() -> std::process::ExitCode {
    tracklens::cli::main()
}
