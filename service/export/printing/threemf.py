"""A face as `.3mf`: the solid that is printed, with its colours, unit, and where it comes from.

3MF core specification 1.3 and materials and properties extension 1.2.1 (3mf.io): a zip of an XML
document, with a picture for file managers.
"""

import io
import zipfile
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import Face
from denseface.service.export.options import PLAIN, ExportOptions
from denseface.service.export.printing.choice import check_printable
from denseface.service.export.printing.solid import Solid, make_solid
from denseface.service.export.provenance import provenance

__all__ = ["MODEL", "NAMESPACE", "to_3mf"]

MODEL, _THUMBNAIL = "3D/3dmodel.model", "Metadata/thumbnail.png"
"""Members of the zip."""
NAMESPACE = "urn:denseface:provenance"
"""Of the names of what is told of a face's making."""
_THUMBNAIL_SIDE = 256
"""Width and height, pixels."""
_EARLIEST = (1980, 1, 1, 0, 0, 0)
"""Time of each member: of one face there is one file."""
_LEVEL = 4
"""Of compression: level 6 takes 2.4 times as long for 2 to 5 % less."""
_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
_MATERIALS = "http://schemas.microsoft.com/3dmanufacturing/material/2015/02"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006"
_TYPES = f"""\
<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="{_PACKAGE}/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
<Default Extension="png" ContentType="image/png"/>
</Types>
"""
_RELATIONS = f"""\
<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="{_PACKAGE}/relationships">
<Relationship Target="/{MODEL}" Id="model" \
Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
<Relationship Target="/{_THUMBNAIL}" Id="thumbnail" \
Type="{_PACKAGE}/relationships/metadata/thumbnail"/>
</Relationships>
"""


def to_3mf(face: Face, options: ExportOptions = PLAIN) -> bytes:
    """Give the bytes of a `.3mf` file: mm, z up from the bed.

    Colours are sRGB at the corners of triangles (a colour group).

    Raises
    ------
    FormatError
        No part of the face is wide enough to be printed.
    UsageError
        An open surface is chosen, which is no solid.
    """
    from denseface.service.export.render import portrait

    check_printable(".3mf", options.printing)
    model = _model(make_solid(face.dense, options.printing), provenance(face.report))
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in (("[Content_Types].xml", _TYPES.encode()),
                           ("_rels/.rels", _RELATIONS.encode()), (MODEL, model),
                           (_THUMBNAIL, portrait(face, _THUMBNAIL_SIDE))):
            how = zipfile.ZIP_STORED if name == _THUMBNAIL else zipfile.ZIP_DEFLATED
            archive.writestr(zipfile.ZipInfo(name, _EARLIEST), data, how, _LEVEL)
    return buffer.getvalue()


def _model(solid: Solid, told: dict[str, str]) -> bytes:
    packed, numbers = np.unique(
        solid.colors.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32),
        return_inverse=True)
    corners = np.hstack([solid.triangles, numbers.astype(np.int32)[solid.paint]])
    told = dict(told)
    metadata = {"Title": "Face", "Application": told.pop("generator", "denseface"),
                **{f"d:{name}": text for name, text in told.items()}}
    return "".join([
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<model unit="millimeter" xml:lang="en-US" xmlns="{_CORE}" xmlns:m="{_MATERIALS}" '
        f'xmlns:d="{NAMESPACE}">\n',
        *(f"<metadata name={quoteattr(name)}>{escape(_printable(text))}</metadata>\n"
          for name, text in metadata.items()),
        '<resources>\n<m:colorgroup id="1">\n',
        _lines('<m:color color="#%06X"/>\n', packed[:, None]),
        '</m:colorgroup>\n<object id="2" type="model" name="face" pid="1" pindex="0">\n<mesh>\n'
        '<vertices>\n',
        _lines('<vertex x="%.4f" y="%.4f" z="%.4f"/>\n', solid.points),
        '</vertices>\n<triangles>\n',
        _lines('<triangle v1="%d" v2="%d" v3="%d" pid="1" p1="%d" p2="%d" p3="%d"/>\n', corners),
        '</triangles>\n</mesh>\n</object>\n</resources>\n<build>\n<item objectid="2"/>\n</build>\n'
        '</model>\n']).encode()


def _printable(text: str) -> str:
    """Leave out what XML does not allow."""
    return "".join(one if one.isprintable() else " " for one in text)


def _lines(line: str, rows: NDArray[np.generic]) -> str:
    """Format a row to a line."""
    return line * len(rows) % tuple(rows.ravel().tolist())
