"""What an `.obj` is called by the files beside it: its material and its texture."""

from pathlib import Path

__all__ = ["beside_obj", "material"]


def beside_obj(path: Path) -> tuple[Path, Path]:
    """Give where an `.obj` has its material and its texture.

    Programs split the lines that name them at spaces, and take what begins with a hyphen for an
    option: names are of letters, digits, dots, hyphens and low lines.
    """
    stem = "".join(one if one.isalnum() or one in "._-" else "_" for one in path.stem)
    stem = stem.encode("utf-8", "replace").decode().replace("?", "_").lstrip("-") or "face"
    return path.with_name(f"{stem}.mtl"), path.with_name(f"{stem}.texture.jpg")


def material(comments: list[str], texture: str) -> bytes:
    """Give the bytes of an `.mtl`: matt, of the texture's colours.

    Parameters
    ----------
    texture : name of the image beside it
    """
    lines = ["# by denseface", *(f"# {line}" for line in comments), "newmtl face",
             "Ka 0 0 0", "Kd 1 1 1", "Ks 0 0 0", "d 1", "illum 1", f"map_Kd {texture}"]
    return "\n".join([*lines, ""]).encode()
