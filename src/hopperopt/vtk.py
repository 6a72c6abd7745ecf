"""Particles of a run as files of the Visualization Toolkit, which ParaView opens: PolyData and a time series.

Lengths in m, times in s. The format: https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html
"""

import base64
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import xarray as xr

from hopperopt import files, moments

SECTORS = 72  # of a revolved surface
MARGIN = 0.012  # m of the hopper's wall above the particles
TYPES = {"float32": "Float32", "int32": "Int32", "int8": "Int8"}


def write(run: Path, stem: Path) -> Path:
    """Write a run's file as STEM.pvd and the files that it names, in the folder STEM_vtk; return its path.

    Part 0 of the series are the particles (`number`, `diameter`, `size_class`, `speed` where it is known, and
    `height` before the discharge), then come hopper and insert. The times are those of the snapshots, or the
    opening and M = 0.5 without. Raises files.InputError for a file that holds no run.
    """
    dataset = moments.read(run)
    folder = stem.with_name(f"{stem.name}_vtk")
    walls = json.loads(dataset.attrs["case"])["walls"]
    top = float(np.nanmax(dataset["position_opening"].values[:, 2], initial=0.0)) + MARGIN
    surfaces = [name for name in ("hopper", "insert") if walls[name] is not None]
    for name in surfaces:
        profile = np.array(walls[name], float)
        _write_polydata(
            folder / f"{name}.vtp", *_revolved(_below(profile, top) if name == "hopper" else profile)
        )
    entries = []
    shown = moments.snapshots(dataset) or moments.stills(dataset).values()
    for number, moment in enumerate(shown):
        particles = f"particles_{number:04d}"
        _write_polydata(folder / f"{particles}.vtp", *_particles(dataset, moment))
        for part, name in enumerate([particles, *surfaces]):
            file = quoteattr(f"{folder.name}/{name}.vtp")
            entries.append(f'<DataSet timestep="{moment.time:.9g}" part="{part}" file={file}/>')
    series = stem.with_name(f"{stem.name}.pvd")
    _write_file(series, "Collection", "<Collection>" + "".join(entries) + "</Collection>")
    return series


def _particles(run: xr.Dataset, moment: moments.Moment) -> tuple:
    """Points inside at a moment, a vertex for each, and their values."""
    inside = np.flatnonzero(np.isfinite(moment.position).all(axis=1))
    values: dict[str, np.ndarray] = {
        "number": np.arange(run.sizes["particle"], dtype=np.int32),
        "diameter": run["diameter"].values.astype(np.float32),
        "size_class": run["size_class"].values.astype(np.int8),
        "height": run["position_opening"].values[:, 2].astype(np.float32),
    }
    if moment.speed is not None:
        values["speed"] = moment.speed.astype(np.float32)
    vertices = np.arange(len(inside), dtype=np.int32)[:, None]
    return moment.position[inside], "Verts", vertices, {name: value[inside] for name, value in values.items()}


def _below(profile: np.ndarray, top: float) -> np.ndarray:
    """The part of a hopper's profile (from the outlet upwards) below a height."""
    r, z = profile.T
    low = z < top
    return np.vstack([profile[low], [np.interp(top, z, r), min(top, z[-1])]])


def _revolved(profile: np.ndarray) -> tuple:
    """Points and quadrangles of a profile r, z revolved about the axis."""
    angle = np.linspace(0.0, 2.0 * np.pi, SECTORS, endpoint=False)
    r, z = profile[:, :1], profile[:, 1:]
    points = np.stack([r * np.cos(angle), r * np.sin(angle), z + 0.0 * angle], axis=-1).reshape(-1, 3)
    first = np.arange(len(profile) - 1)[:, None] * SECTORS
    one, next_one = np.arange(SECTORS), (np.arange(SECTORS) + 1) % SECTORS
    corners = [first + one, first + next_one, first + SECTORS + next_one, first + SECTORS + one]
    return points, "Polys", np.stack(corners, axis=-1).reshape(-1, 4).astype(np.int32), {}


def _write_polydata(
    path: Path, points: np.ndarray, kind: str, cells: np.ndarray, values: Mapping[str, np.ndarray]
) -> None:
    """Write points (n, 3), cells (m, corners) of a kind (Verts or Polys) and values of the points."""
    counts = {"Verts": 0, "Polys": 0} | {kind: len(cells)}
    offsets = np.arange(1, len(cells) + 1, dtype=np.int32) * cells.shape[1]
    counted = " ".join(f'NumberOf{name}="{number}"' for name, number in counts.items())
    content = (
        f'<PolyData><Piece NumberOfPoints="{len(points)}" {counted} NumberOfLines="0" NumberOfStrips="0">'
        + "<PointData>" + "".join(_array(name, value) for name, value in values.items()) + "</PointData>"
        + "<Points>" + _array("Points", points.astype(np.float32)) + "</Points>"
        + f"<{kind}>" + _array("connectivity", cells.ravel()) + _array("offsets", offsets) + f"</{kind}>"
        + "</Piece></PolyData>"
    )  # fmt: skip
    _write_file(path, "PolyData", content)


def _array(name: str, values: np.ndarray) -> str:
    """A data array: the number of its bytes and the bytes, in base64."""
    data = np.uint32(values.nbytes).tobytes() + values.tobytes()
    components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
    return (
        f'<DataArray type="{TYPES[values.dtype.name]}" Name="{name}"{components} format="binary">'
        f"{base64.b64encode(data).decode()}</DataArray>"
    )


def _write_file(path: Path, kind: str, content: str) -> None:
    order = f"{sys.byteorder.title()}Endian"
    head = f'<VTKFile type="{kind}" version="1.0" byte_order="{order}" header_type="UInt32">'
    with files.atomic(path) as temporary:
        temporary.write_text(f'<?xml version="1.0"?>\n{head}{content}</VTKFile>\n', encoding="utf-8")
