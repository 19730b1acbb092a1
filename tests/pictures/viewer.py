"""The rerun viewer without a display: it opens recordings and takes pictures of them.

It needs a software Vulkan driver (Debian: mesa-vulkan-drivers), whose file VK_ICD_FILENAMES may
name.
"""

import os
import socket
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from time import monotonic, sleep
from typing import NamedTuple

import rerun_cli
from PIL import Image
from rerun.experimental import ViewerClient

SIZE = "1600x900"
WIDTH_PX = 1400
TOP_BAR_PX = 30
SOFTWARE_VULKAN = "/usr/share/vulkan/icd.d/lvp_icd.x86_64.json"
START_S = 30.0
SETTLE_S = 40.0
NOTICE_S = 8.0
"""For so long the viewer shows a notice of its start."""


class View(NamedTuple):
    """What to take a picture of: a time [s], a tab of the layout, and the file to write."""

    at_s: float
    tab: str
    file: Path


def take(recording: Path, views: Sequence[View]) -> None:
    """Take pictures (PNG) of a recording."""
    with viewer() as client:
        client.open(str(recording.resolve()))
        sleep(NOTICE_S)
        for view in views:
            client.set_time("sim_time", duration=view.at_s, play_state="paused")
            open_tab(client, view.tab)
            save(settled(client), view.file)


def open_tab(client: ViewerClient, name: str) -> None:
    """Open a tab of the layout by its name."""
    blueprint = client.get_blueprint().blueprint
    containers = {
        path: parts["ContainerBlueprint"]
        for path, parts in blueprint.items()
        if "ContainerBlueprint" in parts
    }
    for path, container in containers.items():
        names = {containers.get(at, {}).get("display_name"): at for at in container["contents"]}
        if name.capitalize() in names:
            blueprint[path]["ContainerBlueprint"]["active_tab"] = names[name.capitalize()]
    client.set_blueprint(blueprint, "recording")


@contextmanager
def viewer() -> Iterator[ViewerClient]:
    """Give a viewer without a window, on a free port of loopback; it ends with the block."""
    port = free_port()
    binary = Path(rerun_cli.__file__).parent / "rerun"
    environment = {"VK_ICD_FILENAMES": SOFTWARE_VULKAN, **os.environ}
    arguments = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", SIZE]
    with subprocess.Popen([binary, *arguments], env=environment) as process:
        try:
            yield connected(port)
        finally:
            process.terminate()


def free_port() -> int:
    """Return a port of loopback that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def connected(port: int) -> ViewerClient:
    """Return a client of the viewer as soon as it answers."""
    until = monotonic() + START_S
    while True:
        try:
            return ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        except (ConnectionError, RuntimeError, ValueError, OSError):
            if monotonic() > until:
                raise
            sleep(0.2)


def settled(client: ViewerClient) -> bytes:
    """Return a picture as soon as two in a row are alike."""
    until = monotonic() + SETTLE_S
    before = b""
    while monotonic() < until:
        picture = client.take_screenshot(max_size=WIDTH_PX)
        if picture == before:
            break
        before = picture
        sleep(0.5)
    return before


def save(picture: bytes, out: Path) -> None:
    """Write a picture without the viewer's own top bar."""
    with Image.open(BytesIO(picture)) as image:
        width, height = image.size
        page = image.convert("RGB").crop((0, TOP_BAR_PX, width, height))
        page.save(out, optimize=True)
