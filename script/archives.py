"""Compare folders of archives to the byte, and pack a folder so that the bytes are the same again.

    python script/archives.py same FOLDER FOLDER     status 1, and what differs, where any byte does
    python script/archives.py pack FOLDER OUT.tar.gz  files below a folder of OUT's name

SOURCE_DATE_EPOCH is the time of all that is packed.
"""

import gzip
import hashlib
import io
import os
import sys
import tarfile
import zipfile
from pathlib import Path

_EPOCH_1980 = 315532800
"""Seconds; where SOURCE_DATE_EPOCH is not set. The first that a .zip can hold."""


def differences(one: Path, two: Path) -> list[str]:
    """Say what differs of two folders of files, one line each: files, members of archives, order.

    Parameters
    ----------
    one, two : folders; what is below their folders counts too
    """
    here, there = ({path.relative_to(folder).as_posix(): path for path in sorted(
        folder.rglob("*")) if path.is_file()} for folder in (one, two))
    found = [f"{name}: only in {folder}" for files, others, folder in (
        (here, there, one), (there, here, two)) for name in files if name not in others]
    for name in sorted(here.keys() & there.keys()):
        if here[name].read_bytes() != there[name].read_bytes():
            found += [f"{name}: {line}" for line in _within(here[name], there[name])]
    return found


def _within(one: Path, two: Path) -> list[str]:
    """Say how two files differ that do."""
    try:
        before, after = _members(one), _members(two)
    except (tarfile.TarError, zipfile.BadZipFile, OSError):
        return ["other bytes"]
    if before is None or after is None:
        return ["other bytes"]
    lines = [f"{name}: only in {path}" for names, others, path in (
        (before, after, one), (after, before, two)) for name in names if name not in others]
    for name in sorted(before.keys() & after.keys()):
        lines += [f"{name}: {what} {old} and {new}" for what, old, new in zip(
            ("mode", "time", "owner", "kind", "content"), before[name], after[name], strict=True)
            if old != new]
    if not lines and list(before) != list(after):
        lines = ["the same members in another order"]
    return lines or ["the same members, packed otherwise: another zlib?"]


def _members(path: Path) -> dict[str, tuple[object, ...]] | None:
    """Give mode, time, owner, kind and digest of each member; None of what is no archive."""
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            return {one.filename: (oct(one.external_attr >> 16), one.date_time, "",
                                   one.create_system, _digest(archive.read(one)))
                    for one in archive.infolist()}
    if not tarfile.is_tarfile(path):
        return None
    with tarfile.open(path) as archive:
        found: dict[str, tuple[object, ...]] = {}
        for member in archive:
            content = archive.extractfile(member) if member.isfile() else None
            owner = member.uid, member.gid, member.uname, member.gname
            found[member.name] = (
                oct(member.mode), member.mtime, owner, member.type,
                _digest(content.read()) if content else member.linkname)
        return found


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:12]


def pack(folder: Path, out: Path) -> None:
    """Pack a folder's files, below a folder of the archive's name without `.tar.gz`.

    Names in order, modes 644 and 755, nobody's, at SOURCE_DATE_EPOCH; links stay links.
    """
    epoch = int(os.environ.get("SOURCE_DATE_EPOCH", _EPOCH_1980))
    top = out.name.removesuffix(".tar.gz")
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as archive:
        for path in sorted(folder.rglob("*"), key=lambda one: one.relative_to(folder).as_posix()):
            if path.is_dir() and not path.is_symlink():
                continue
            member = archive.gettarinfo(path, f"{top}/{path.relative_to(folder).as_posix()}")
            member.uid = member.gid = 0
            member.uname = member.gname = ""
            member.mtime = epoch
            if member.issym():
                member.mode = 0o777
                archive.addfile(member)
                continue
            # Of two names of one file, each is a file.
            member.type, member.linkname, member.size = tarfile.REGTYPE, "", path.stat().st_size
            member.mode = 0o755 if member.mode & 0o100 else 0o644
            with path.open("rb") as content:
                archive.addfile(member, content)
    with out.open("wb") as file, gzip.GzipFile("", "wb", 9, file, epoch) as compressed:
        compressed.write(packed.getvalue())


def main() -> int:
    """Do what the command line says and give the exit status."""
    match sys.argv[1:]:
        case ["same", one, two]:
            lines = differences(Path(one), Path(two))
            sys.stderr.write("".join(f"{line}\n" for line in lines))
            return 1 if lines else 0
        case ["pack", folder, out]:
            pack(Path(folder), Path(out))
            return 0
    sys.stderr.write(__doc__ or "")
    return 2


if __name__ == "__main__":
    sys.exit(main())
