"""From a film of a shell to its height and width in time: frames, outline, convex hull, each with its error."""

from jshell.camera.distortion import Lens, lens_from_grid
from jshell.camera.film import Filmed, View, measure
from jshell.camera.frames import open_film
from jshell.camera.outlines import write_outlines
from jshell.camera.rendering import Scene, render, render_grid, silhouette

__all__ = [
    "Filmed", "Lens", "Scene", "View", "lens_from_grid", "measure", "open_film", "render", "render_grid", "silhouette",
    "write_outlines",
]  # fmt: skip
