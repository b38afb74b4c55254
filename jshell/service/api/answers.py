"""What every route says of itself: the problems it may answer with, and the media types of its files."""

from collections.abc import Callable, Coroutine, Mapping
from typing import Annotated, Any

from fastapi import Depends, HTTPException, Path, Query, Request, Response
from fastapi.routing import APIRoute
from starlette.convertors import StringConvertor, register_url_convertor

from jshell.errors import BadValue
from jshell.service.problems import KINDS, MEDIA_TYPE
from jshell.service.reading import read_json


class Key(StringConvertor):
    """An identifier in an address: no dot, so that `FIT.csv` is not taken for a fit of that name."""

    regex = "[^/.]+"


register_url_convertor("key", Key())
ALWAYS = (400, 401, 403, 408, 413, 421, 422, 500, 503)
_PROBLEM = {"$ref": "#/components/schemas/ProblemOut"}
Name = Annotated[str, Path(pattern=r"^[0-9a-f]{8,64}$", description="Identifier.", examples=["6f1d0c2b9a8e"])]
Limit = Annotated[int, Query(ge=1, le=200, description="Most rows of a page.")]
Before = Annotated[
    str | None, Query(pattern=r"^[0-9a-f]{8,64}$", description="Identifier; rows older than it are given.")
]
_LINK = {"Location": {"description": "Where the thing made stands.", "schema": {"type": "string"}, "required": True}}


def problem_responses(
    *statuses: int, made: tuple[int, ...] = (), more: Mapping[int, Any] = {}
) -> dict[int | str, dict[str, Any]]:
    """The problems of a route beside those that any may have.

    Args:
        statuses: Of problems.
        made: Of answers that carry a Location.
        more: Other answers.
    """
    answers: dict[int | str, dict[str, Any]] = {}
    for status in sorted({*ALWAYS, *statuses}):
        words = "; ".join(kind.title for kind in KINDS.values() if kind.status == status)
        answers[status] = {"description": words, "content": {MEDIA_TYPE: {"schema": _PROBLEM}}}
    if 429 in answers:
        answers[429]["headers"] = {
            "Retry-After": {"description": "Seconds.", "schema": {"type": "string"}, "required": True}
        }
    for status in made:
        answers[status] = {"headers": _LINK}
    return answers | dict(more)


async def _once(request: Request) -> None:
    sent = await request.form()
    for name in ("file", "conditions", "options", "grid"):
        if len(sent.getlist(name)) > 1:
            raise BadValue(
                f"field {name}", found="it twice or more", expected="it once", remedy="Send one value for every field."
            )


class _Strict(Request):
    async def json(self) -> Any:
        try:
            return read_json(await self.body())
        except (ValueError, RecursionError) as error:
            raise HTTPException(400, f"no JSON that can be used: {str(error) or 'too deep'}") from None


class Route(APIRoute):
    """A route whose JSON is read once and means one thing."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """As FastAPI's, of a stricter request."""
        handle = super().get_route_handler()

        async def strict(request: Request) -> Response:
            return await handle(_Strict(request.scope, request.receive))

        return strict


ONCE = Depends(_once)  # a field of a form that stands there twice is no field


def binary(media: str, words: str, json: str = "object") -> dict[int, Any]:
    """An answer that is a file; where it is JSON, of an `object` or an `array`."""
    schema = {"type": json} if media == "application/json" else {"type": "string", "format": "binary"}
    return {200: {"description": words, "content": {media: {"schema": schema}}}}
