"""temporary"""

from __future__ import annotations
from pipeline.stage import Outcome, Task

__all__ = ["draw_preview"]


def draw_preview(task: Task) -> Outcome:
    import io, PIL.Image

    b = io.BytesIO()
    PIL.Image.new("RGB", (64, 64), (255, 255, 255)).save(b, "png")
    with task.output(f"{task.shard.name}.png") as s:
        s.write(b.getvalue())
    return Outcome(0)
