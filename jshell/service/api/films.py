"""Films: handed in with what is known of the camera, measured as jobs."""

from typing import Annotated, no_type_check

from fastapi import APIRouter, File, Form, Response, UploadFile

from jshell.camera.frames import FILMS
from jshell.errors import BadName
from jshell.service.api.answers import ONCE, Route
from jshell.service.api.jobs import ACCEPTED, IdempotencyKey, accepted
from jshell.service.films import is_film
from jshell.service.jobs import specification
from jshell.service.reading import UPLOAD_SLOTS, options_of
from jshell.service.safety import clean_name
from jshell.service.schemas import FilmOptions
from jshell.service.state import Here
from jshell.service.uploads import Upload

router = APIRouter(prefix="/films", tags=["films"], route_class=Route)


@router.post("", status_code=202, responses=ACCEPTED, summary="Measure a film", dependencies=[ONCE])
@no_type_check  # FastAPI hands in Starlette's UploadFile where its own is announced
def measure(
    here: Here,
    file: Annotated[UploadFile, File(description="TIFF stack, video, .cine, or a .zip of pictures.")],
    grid: Annotated[
        UploadFile | None, File(description="Picture of a grid of dots through the same window: takes bends off.")
    ] = None,
    options: Annotated[str, Form(description='What is known of the camera: {"rate": 1000, "pixel": 5e-4}.')] = "{}",
    key: IdempotencyKey = None,
) -> Response:
    """Outline the shell in every frame: height and width in time, and on to their frequencies."""
    chosen = options_of(FilmOptions, options)
    with UPLOAD_SLOTS:
        name, content = clean_name(file.filename), file.file.read()
        if not is_film(name, content):
            raise BadName(
                name, found="no film by its name", expected=", ".join((*FILMS, ".zip of pictures")),
                remedy="Export the film as a TIFF stack, or zip its pictures; ImageJ and ffmpeg do.",
            )  # fmt: skip
        given, asked = [Upload.of(name, content)], specification(chosen)
        if grid is not None and grid.filename:
            given.append(Upload.of(clean_name(grid.filename), grid.file.read()))
            asked["grid"] = True
        return accepted(here, here.store.submit("film", asked, given, key))
