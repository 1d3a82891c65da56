"""Writes photos/: frames of panda_push as JPEG, WebP and PNG, and what Pillow decodes from them as PNG.

    pip install pillow==13.0.0
    python3 make_photos.py
"""

from pathlib import Path

from PIL import Image

DATA = Path(__file__).resolve().parent
FRAMES = DATA / "panda_push" / "seq_0000"
FORMATS = [
    ("jpg", {"quality": 90, "subsampling": "4:2:0"}),
    ("jpg", {"quality": 90, "subsampling": "4:4:4", "progressive": True}),
    ("webp", {"quality": 90}),
    ("webp", {"lossless": True}),
    ("png", {}),
]

for folder in ("seq_0000", "decoded"):
    (DATA / "photos" / folder).mkdir(parents=True, exist_ok=True)
for i, (ending, options) in enumerate(FORMATS):
    image = Image.open(FRAMES / f"frame_{i:03}.png").convert("RGB").crop((40, 20, 168, 148))
    path = DATA / "photos" / "seq_0000" / f"frame_{i:03}.{ending}"
    image.save(path, **options)
    Image.open(path).convert("RGB").save(DATA / "photos" / "decoded" / f"frame_{i:03}.png", optimize=True)
