"""What the figures of a study have in common: axes, colours, and files that come out the same."""

from io import BytesIO
from pathlib import Path

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

INK = "#333333"
COUNT_COLOURS = ("#9a9a9a", "#e9a23b", "#d1495b", "#2a9d8f", "#1b3a57")
ROBOT_COLOURS = ("#1b3a57", "#d1495b", "#2a9d8f", "#e9a23b", "#7b5ea7")
DPI = 100
PALETTE = 192
"""Colours of a PNG: enough for lines and shades, and a third of the bytes."""


def decorate(axes: Axes, title: str, x_label: str, y_label: str) -> None:
    """Title on the left, light grid, no frame above and on the right."""
    axes.set_title(title, loc="left", color=INK, fontsize=10)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.grid(color="#dddddd", lw=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(colors=INK)


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write PNG and PDF without dates, so that equal figures are equal files."""
    png, pdf = folder / f"{name}.png", folder / f"{name}.pdf"
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # laid out now; laying out again for each file is slow
    drawn = BytesIO()
    figure.savefig(drawn, dpi=DPI, metadata={"Software": None})
    with Image.open(drawn) as image:
        image.convert("RGB").quantize(PALETTE, dither=Image.Dither.NONE).save(png, optimize=True)
    with rc_context({"pdf.fonttype": 42}):
        figure.savefig(pdf, metadata={"CreationDate": None, "Creator": None, "Producer": None})
    return [png, pdf]
