"""Names that attack whoever shows them, and a published block whose things have them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest
from PIL import Image

from benchmarks.painter.exemplars import paint_exemplar_set
from tasks.publish.task import publish_block
from tests.pipeline.stages import Textured, texture, write_block

MARKUP = (
    "<script>alert(1)</script>\"'`onmouseover=alert(1) [click](javascript:alert(1)) ![](http://evil.example/x) **b** "
    "[/red][link=http://evil.example]x[/link] {{ 7*7 }} https://evil.example www.evil.example a@evil.example _i_"
)
CONTROLS = "\x1b[31m\x07\x9b2J\x1b]8;;mailto:x\x07\u202egnp.\r\n\ttwo\u2028lines"
DATA = '=1+1\';DROP TABLE items;--"}],"x":{"\\u0000 ]]>&lt;<!ENTITY x SYSTEM "file:///etc/passwd">&x; ?#%41&b=1+2 \ufffe\u00e9'
LONG = "L" * 300
BROKEN = "<img src=x onerror=alert(1)>[bold]\x1b[31m.png"


@contextmanager
def hostile_block(top: Path) -> Iterator[SimpleNamespace]:
    """A published block in a folder whose things have such names; two would lead out of any folder."""
    names = [MARKUP, "../../escaped", str(top / "absolute"), CONTROLS, DATA, LONG]
    picture = Image.fromarray(paint_exemplar_set(1, seed=5, metres_per_pixel=0.2)[0].image)
    for folder, file in (("exemplars", "good\x1b[1m\n<b>.png"), ("photos", f"{CONTROLS}-0.png")):
        (top / "in" / folder).mkdir(parents=True)
        picture.save(top / "in" / folder / file)
    (top / "in" / "exemplars" / BROKEN).write_bytes(b"no picture")
    block = write_block(
        top / "in",
        buildings={name: (4 + 8 * i, 5, 6, 2.8, 7.0) for i, name in enumerate(names)},
        streets={MARKUP: [(0, 0), (24, 0)], CONTROLS + DATA: [(24, 0), (48, 0)]},
        texture={"visibility_range": 12.0},
    )
    with pytest.MonkeyPatch.context() as patch:
        # readers set aside what is no letter, and a store may be older than they: what is shown must not rely on them
        for refusal in ("catalogs.readers.limits._limit_violation", "catalogs.readers.pictures.folders._name_problem"):
            patch.setattr(refusal, lambda item: None)
        for reader in ("catalogs.readers.limits.to_single_line", "catalogs.readers.pictures.folders.to_single_line"):
            patch.setattr(reader, lambda text: text)
        textured: Textured = texture(block, top / "out")
        summary = publish_block.fn(textured.run, block)
    published = top / "out" / "published" / (top / "out" / "current").read_text().strip()
    yield SimpleNamespace(top=top, out=top / "out", names=names, run=textured.run, summary=summary, published=published)
    outside = {path.name for path in top.iterdir()} - {"in", "out", "exports"}
    assert not outside
    assert not list(top.parent.glob("escaped*"))
