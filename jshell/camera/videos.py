"""Videos as cameras, screens and editors write them, by FFmpeg through PyAV: frames in the order they are shown."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from jshell.camera.forms import MOST_FRAMES, Film, check_form, grey
from jshell.errors import BadFile, require_extra
from jshell.io.files import SPOILED, check_file, spoiled

VIDEOS = (".avi", ".mp4", ".mov", ".mkv", ".m4v", ".wmv", ".webm")
DEEP = 8  # bits; a video of more is read with 16


def video(path: Path) -> Film:
    """A video whose frames have been counted, and none of them decoded.

    Raises:
        BadFile: No video, too large, or frames without a time.
        MissingExtra: The extra `camera` is not installed.
    """
    check_file(path)
    library = require_extra("av", "camera", "videos")
    broken = (*SPOILED, library.FFmpegError)
    where = str(path)
    try:
        with library.open(where) as container:
            if not container.streams.video:
                raise BadFile(where, found="no moving picture", expected="a video", remedy="Name the film.")
            stream = container.streams.video[0]
            shape = int(stream.height), int(stream.width)
            check_form(where, 1, shape)
            depth = max((part.bits for part in stream.codec_context.format.components), default=DEEP)
            times = _times(where, container, stream)
    except broken as error:
        raise spoiled(where, "video", error) from None
    check_form(where, len(times), shape)
    form, white = ("gray", 255.0) if depth <= DEEP else ("gray16le", 65535.0)
    decoder = _Decoder(library, path)

    def read(number: int) -> Float[np.ndarray, "rows columns"]:
        place = f"{where}, frame {number + 1}"
        try:
            frame = decoder.frame(number)
        except broken as error:
            raise spoiled(place, "video", error) from None
        if frame is None:
            raise BadFile(place, found="the end", expected=f"{len(times)} frames", remedy="Convert the film again.")
        return grey(place, frame.to_ndarray(format=form), shape)

    return Film(where, len(times), shape, white, read, decoder.close, times, playback=True)


def _times(where: str, container: Any, stream: Any) -> Float[np.ndarray, "frames"]:
    """When each frame is shown, from the first [s]: packets are looked at, not decoded."""
    stamps = []
    for packet in container.demux(stream):
        if packet.size == 0:
            continue
        stamps.append(packet.dts if packet.pts is None else packet.pts)
        if len(stamps) > MOST_FRAMES or stamps[-1] is None:
            found = "a frame without a time" if stamps[-1] is None else f"over {MOST_FRAMES} frames"
            raise BadFile(where, found=found, expected="a film", remedy="Convert it with ffmpeg.")
    # packets come in the order of decoding, frames in that of showing
    times = np.sort(np.array(stamps, float)) * float(stream.time_base)
    return times - times[0] if len(times) else times


class _Decoder:
    """Frames by number, quick where they are asked for in turn."""

    def __init__(self, library: Any, path: Path) -> None:
        self._library, self._path = library, path
        self._container: Any = None
        self._frames: Iterator[Any] = iter(())
        self._next = 0

    def frame(self, number: int) -> Any:
        """The frame of a number; None behind the last."""
        if self._container is None or number < self._next:
            self.close()
            self._container = self._library.open(str(self._path))
            self._frames, self._next = self._container.decode(video=0), 0
        found = None
        while self._next <= number:
            found = next(self._frames, None)
            self._next += 1
        return found

    def close(self) -> None:
        """Close the file."""
        if self._container is not None:
            self._container.close()
            self._container = None
