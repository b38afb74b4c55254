"""The outlines of a film as a NetCDF file: columns x and y of every point, frame by frame, padded with NaN."""

from pathlib import Path

import numpy as np

from jshell.camera.film import Filmed
from jshell.errors import BadName, require_extra

SUFFIXES = (".nc", ".nc4")


def write_outlines(path: str | Path, filmed: Filmed) -> None:
    """Write the outlines of every frame that shows a shell.

    Args:
        path: `.nc`; opened by xarray as dimensions `t` [s] and `point`, variables `x`, `y` (columns and rows [px]),
            `sigma` [px] and `frame`, counted from 0; the direction of the axis [degrees] is an attribute.
        filmed: What `measure` has found.

    Raises:
        BadName: Another suffix.
        MissingExtra: h5netcdf is not installed.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise BadName(str(path), found=path.suffix, expected=" or ".join(SUFFIXES), remedy="Name it outlines.nc.")
    library = require_extra("h5netcdf", "io", "NetCDF files")
    seen = [(number, one) for number, one in enumerate(filmed.outlines) if one is not None]
    longest = max(len(one.points) for _, one in seen)
    points = np.full((len(seen), longest, 2), np.nan)
    for row, (_, one) in zip(points, seen, strict=True):
        row[: len(one.points)] = one.points
    with library.File(path, "w") as file:
        file.dimensions = {"t": len(seen), "point": longest}
        file.attrs["axis_degrees"] = filmed.axis
        for name, dimensions, unit, values in (
            ("t", ("t",), "s", np.asarray(filmed.trace.times)),
            ("frame", ("t",), "1", np.array([number for number, _ in seen])),
            ("sigma", ("t",), "px", np.array([one.sigma for _, one in seen])),
            ("x", ("t", "point"), "px", points[..., 0]),
            ("y", ("t", "point"), "px", points[..., 1]),
        ):
            variable = file.create_variable(name, dimensions, values.dtype, compression="gzip")
            variable[:] = values
            variable.attrs["units"] = unit
