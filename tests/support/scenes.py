"""The scenes of docs/examples/scenes, made small."""
import re
from pathlib import Path

SCENES = Path("docs/examples/scenes").absolute()


def small(folder, scene, **keys):
    """The example with these numbers in it, beside the files it names."""
    text = (SCENES / scene).read_text()
    for key, value in {"width": 32, "height": 24, "grid": 1, **keys}.items():
        text = re.sub(rf"{key}: \d+", f"{key}: {value}", text)
    for other in SCENES.glob("*"):
        if other.suffix != ".yaml":
            (folder / other.name).write_bytes(other.read_bytes())
    path = folder / scene
    path.write_text(text)
    return path
