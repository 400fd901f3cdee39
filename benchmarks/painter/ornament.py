"""Ornament of a wall: cornices, string courses, quoins, window surrounds, sills, doorways."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.painter.canvas import Canvas, hex_to_linear
from benchmarks.painter.facade_plan import FacadePlan, PaintedOpening
from facade_core.core.arrays import Float32Array, FloatArray

Box = tuple[float, float, float, float]
# Projections of mouldings in metres, from top to bottom.
CORNICE_PROFILE_M = (0.62, 0.62, 0.60, 0.52, 0.46, 0.26, 0.20, 0.13, 0.12, 0.05)
STRING_COURSE_PROFILE_M = (0.14, 0.14, 0.10, 0.07, 0.02)
SILL_PROFILE_M = (0.12, 0.12, 0.09, 0.04)


@dataclass(frozen=True)
class FacadePalette:
    """Colours of a facade, (3,) in linear light.

    Attributes
    ----------
    wall, trim, base, door, roof : colour of each part.
    """

    wall: Float32Array
    trim: Float32Array
    base: Float32Array
    door: Float32Array
    roof: Float32Array


def paint_crown(canvas: Canvas, plan: FacadePlan, palette: FacadePalette) -> None:
    """Paint the cornice, frieze or parapet between the top windows and the roof.

    Parameters
    ----------
    canvas : changed in place.
    plan : layout of the facade.
    palette : its colours.
    """
    mpp, style, w = plan.metres_per_pixel, plan.style, canvas.width_m
    y0, y1 = plan.roof * mpp, (plan.roof + plan.crown) * mpp
    tall, trim = y1 - y0, palette.trim
    if style.name == "functionalist" or style.top == "coping":
        canvas.add_moulding(0, y0, w, y0 + 0.12, hex_to_linear("#7d8082"), (0.12, 0.12, 0.06))
        return
    if style.name == "post-war" or style.top == "eaves":
        # Boarded eaves with their shadow.
        canvas.add_moulding(0, y0, w, y0 + 0.5 * tall, trim * 0.9, (0.45, 0.45, 0.42, 0.30))
        return
    if style.name == "art-deco":
        canvas.add_moulding(0, y0, w, y0 + 0.10, hex_to_linear("#55585a"), (0.16, 0.16, 0.08))
        _paint_stepped_parapet(canvas, plan, y0 + 0.10, y1, trim)
        return
    if style.name in ("classicism", "plaster"):
        canvas.add_moulding(0, y0, w, y0 + 0.55 * tall, trim, CORNICE_PROFILE_M)
        if style.name == "plaster":
            _paint_dentils(canvas, y0 + 0.34 * tall, y0 + 0.55 * tall, trim, pitch=0.62, relief=0.36)
            canvas.add_moulding(0, y1 - 0.12, w, y1, trim, STRING_COURSE_PROFILE_M[1:])
        else:
            canvas.fill_box(0, y0 + 0.55 * tall, w, y1, 0.5 * (palette.wall + trim), 0.02)
        return
    if style.name == "neoclassical":
        canvas.fill_box(0, y0, w, y0 + 0.45 * tall, trim * 0.97, 0.10)
        canvas.fill_box(0, y0, w, y0 + 0.09 * tall, trim, 0.18)
        _paint_panels(canvas, plan, y0 + 0.14 * tall, y0 + 0.40 * tall, trim)
        y0 += 0.45 * tall
        canvas.add_moulding(0, y0, w, y1, trim, CORNICE_PROFILE_M)
        _paint_dentils(canvas, y0 + 0.52 * (y1 - y0), y0 + 0.78 * (y1 - y0), trim, pitch=0.34, relief=0.26)
        return
    if style.name == "brick":
        canvas.add_moulding(0, y0, w, y0 + 0.16, trim, (0.36, 0.36, 0.30))
        canvas.relief[canvas.region(0, y0 + 0.16, w, y0 + 0.55 * tall)] += 0.18
        _paint_corbels(canvas, y0 + 0.55 * tall, y0 + 0.80 * tall)
        canvas.add_moulding(0, y0 + 0.80 * tall, w, y1, trim, (0.08, 0.08, 0.05))
        return
    canvas.add_moulding(0, y0, w, y0 + 0.55 * tall, trim, CORNICE_PROFILE_M)
    if style.name == "haussmann":
        _paint_dentils(canvas, y0 + 0.32 * tall, y0 + 0.50 * tall, trim, pitch=0.30, relief=0.28)
    else:
        _paint_garland(canvas, plan, y0 + 0.60 * tall, y1, trim)


def paint_courses_quoins_plinth(canvas: Canvas, plan: FacadePlan, palette: FacadePalette) -> list[float]:
    """Paint string courses at the floor lines, corner quoins and the plinth; return the courses.

    Parameters
    ----------
    canvas : changed in place.
    plan : layout of the facade.
    palette : its colours.

    Returns
    -------
    ledges : y of each course in metres.
    """
    mpp, style, w = plan.metres_per_pixel, plan.style, canvas.width_m
    lines = [y * mpp for y in plan.lines]
    trim = palette.trim
    ledges = lines[1:-1]
    if style.name == "neoclassical":
        for y in lines[2:-1]:
            canvas.add_moulding(0, y - 0.07, w, y + 0.07, trim, STRING_COURSE_PROFILE_M[1:])
        paint_quoins(canvas, plan, lines[-1], lines[1], trim)
    elif style.name == "haussmann":
        for y in lines[2:-1]:
            canvas.add_moulding(0, y - 0.05, w, y + 0.10, trim, STRING_COURSE_PROFILE_M)
    elif style.name == "brick":
        ledges = lines[1:-1:2]
        for y in lines[3:-1:2]:
            canvas.add_moulding(0, y + 0.02, w, y + 0.20, trim, (0.07, 0.07, 0.05))
    elif style.name == "jugend":
        ledges = lines[1:2]
        if plan.floors > 3:
            # The top floor is an attic, with a course of its own.
            ledges.append(lines[-2])
            canvas.add_moulding(0, lines[-2] - 0.06, w, lines[-2] + 0.10, trim, STRING_COURSE_PROFILE_M)
    elif style.name == "classicism":
        ledges = lines[1:2]
        if plan.floors > 4:
            ledges.append(lines[2])
            canvas.add_moulding(0, lines[2] - 0.05, w, lines[2] + 0.07, trim, STRING_COURSE_PROFILE_M[1:])
    elif style.name == "plaster":
        for y in lines[2:-1]:
            canvas.add_moulding(0, y - 0.06, w, y + 0.08, trim, STRING_COURSE_PROFILE_M)
    elif style.name == "art-deco":
        ledges = lines[1:2]
        _paint_pilasters(canvas, plan, palette)
    else:
        ledges = []
        if style.name == "functionalist":
            _paint_ribbons(canvas, plan)
    if plan.floors > 1 and style.name != "post-war" and style.base != "wall":
        y = lines[1]
        canvas.add_moulding(
            0,
            y - 0.16,
            w,
            y + 0.12,
            trim if style.base != "tile" else palette.base * 1.2,
            (0.24, *STRING_COURSE_PROFILE_M),
        )
    if style.base == "wall":
        return ledges
    plinth = min(0.55, 0.16 * (lines[0] - lines[1]))
    at = canvas.region(0, lines[0] - plinth, w, lines[0])
    canvas.albedo[at] *= 0.82
    canvas.relief[at] += 0.05
    canvas.add_moulding(
        0, lines[0] - plinth - 0.05, w, lines[0] - plinth + 0.03, palette.base * 0.9, (0.12, 0.12, 0.08)
    )
    return ledges


def _paint_ribbons(canvas: Canvas, plan: FacadePlan) -> None:
    """Paint dark bands between the windows of a floor."""
    mpp = plan.metres_per_pixel
    rows = {(o.box[1], o.box[3]) for o in plan.openings if o.label == "window" and o.kind == "plain"}
    inset = 0.5 * (plan.pitch * mpp) - 0.5 * min(plan.style.window_share * plan.pitch * mpp, plan.style.window_widest)
    for top, bottom in sorted(rows):
        at = canvas.region(inset, top * mpp, canvas.width_m - inset, bottom * mpp)
        canvas.albedo[at] *= np.array([0.80, 0.78, 0.76], np.float32)
        canvas.relief[at] -= 0.03


def _paint_pilasters(canvas: Canvas, plan: FacadePlan, palette: FacadePalette) -> None:
    """Paint fluted strips between the windows of all upper floors, and spandrels with ribs."""
    mpp, style = plan.metres_per_pixel, plan.style
    pitch, top, foot = plan.pitch * mpp, (plan.roof + plan.crown) * mpp, plan.lines[1] * mpp
    window = min(style.window_share * pitch, style.window_widest)
    half = 0.5 * min(0.75, 0.6 * (pitch - window))
    for opening in plan.openings:
        if opening.label == "window" and opening.kind == "plain" and opening.floor > 1:
            x0, _, x1, y1 = (v * mpp for v in opening.box)
            below = y1 + 0.9 * (plan.lines[opening.floor] * mpp - y1) + 0.15
            canvas.fill_box(x0, y1 + 0.16, x1, below, palette.trim * 0.86, -0.03)
            for x in np.linspace(x0, x1, 7)[1:-1]:
                canvas.fill_box(x - 0.03, y1 + 0.2, x + 0.03, below - 0.04, palette.trim * 0.95, 0.02)
    if half < 0.12:
        return
    for x in np.arange(round(canvas.width_m / pitch) + 1) * pitch:
        canvas.fill_box(x - half, top, x + half, foot, palette.wall * 1.06, 0.08)
        for flute in (-0.5, 0.0, 0.5):
            canvas.fill_box(
                x + half * flute - 0.02, top + 0.1, x + half * flute + 0.02, foot - 0.25, palette.wall * 0.96, 0.05
            )


def _paint_stepped_parapet(canvas: Canvas, plan: FacadePlan, y0: float, y1: float, colour: FloatArray) -> None:
    """Paint a parapet in low relief, stepped over every pier."""
    pitch = plan.pitch * plan.metres_per_pixel
    for x in np.arange(round(canvas.width_m / pitch) + 1) * pitch:
        for half, share, relief in ((0.30, 0.95, 0.05), (0.20, 0.80, 0.09), (0.10, 0.62, 0.13)):
            canvas.fill_box(x - half * pitch, y0, x + half * pitch, y0 + share * (y1 - y0), colour, relief)


def paint_quoins(canvas: Canvas, plan: FacadePlan, y0: float, y1: float, colour: Float32Array) -> None:
    """Paint corner stones, long and short in turn, up to the first windows.

    Parameters
    ----------
    canvas : changed in place.
    plan : layout of the facade.
    y0, y1 : top and bottom in metres.
    colour : (3,) linear light.
    """
    pitch = plan.pitch * plan.metres_per_pixel
    room = 0.5 * (pitch - min(plan.style.window_share * pitch, plan.style.window_widest)) - 0.30
    if room < 0.2:
        return
    count = max(2, round((y1 - y0) / 0.46))
    edges = np.linspace(y0, y1, count + 1)
    for number, (top, bottom) in enumerate(zip(edges, edges[1:], strict=False)):
        long = min(0.72 if number % 2 else 0.46, room)
        tone = colour * (0.97 + 0.05 * ((number * 7) % 3))
        for x0, x1 in ((0.0, long), (canvas.width_m - long, canvas.width_m)):
            canvas.fill_box(x0, top + 0.018, x1, bottom - 0.018, tone, 0.055)


def paint_window_surround(
    canvas: Canvas, plan: FacadePlan, opening: PaintedOpening, box: Box, palette: FacadePalette
) -> None:
    """Paint the surround of a window, before the window itself.

    Parameters
    ----------
    canvas : changed in place.
    plan : layout of the facade.
    opening : the window.
    box : its x0, y0, x1, y1 in metres.
    palette : colours of the facade.
    """
    x0, y0, x1, y1 = box
    trim, kind = palette.trim, plan.style.surround
    if opening.floor == 0 and plan.style.base == "granite":
        trim = palette.base * 1.25
    if opening.kind == "dormer":
        _paint_dormer(canvas, box, palette)
        return
    if opening.kind == "ground" and plan.style.base == "banded":
        _paint_voussoirs(canvas, box, palette.base)
        return
    if kind == "flush":
        return
    if kind == "none":
        paint_sill(canvas, box, hex_to_linear("#8f9294"), out=0.06)
        return
    if kind == "thin":
        canvas.fill_box(x0 - 0.10, y0 - 0.10, x1 + 0.10, y1, trim, 0.025)
        paint_sill(canvas, box, trim if plan.style.name == "classicism" else hex_to_linear("#84888a"), out=0.12)
        return
    if kind == "band":
        rise = 0.20 * (x1 - x0) if opening.kind == "arched" else 0.0
        if rise:
            across = np.linspace(-1, 1, 17)
            arch = [((x0 + x1) / 2 + a * ((x1 - x0) / 2 + 0.16), y0 - 0.16 + rise * a * a) for a in across]
            canvas.fill_polygon([*arch, (x1 + 0.16, y1), (x0 - 0.16, y1)], trim, 0.04)
        else:
            canvas.fill_box(x0 - 0.14, y0 - 0.14, x1 + 0.14, y1, trim, 0.035)
            canvas.fill_box(x0 - 0.22, y0 - 0.14, x1 + 0.22, y0 - 0.06, trim, 0.06)
            if opening.kind == "plain":
                canvas.fill_box(x0 + 0.1, y1 + 0.10, x1 - 0.1, y1 + 0.42, trim * 0.95, 0.02)
                canvas.fill_box(x0 + 0.2, y1 + 0.18, x1 - 0.2, y1 + 0.34, palette.wall * 0.92, 0.005)
        paint_sill(canvas, box, trim, out=0.16)
    elif kind == "brick":
        _paint_brick_arch(canvas, box, palette.wall if opening.floor else palette.base, trim)
        paint_sill(canvas, box, trim, out=0.10)
    elif kind == "classical":
        canvas.fill_box(x0 - 0.17, y0 - 0.17, x1 + 0.17, y1, trim, 0.05)
        canvas.fill_box(x0 - 0.07, y0 - 0.07, x1 + 0.07, y1, trim * 0.96, 0.03)
        if opening.floor == 1 and plan.floors > 2:
            _paint_pediment(canvas, box, trim, is_curved=opening.column % 2 == 1)
        elif opening.floor < plan.floors - 1 or plan.floors <= 2:
            canvas.add_moulding(x0 - 0.26, y0 - 0.40, x1 + 0.26, y0 - 0.25, trim, (0.20, 0.20, 0.14, 0.06))
        paint_sill(canvas, box, trim, out=0.20)
    else:
        canvas.fill_box(x0 - 0.14, y0 - 0.14, x1 + 0.14, y1, trim, 0.04)
        canvas.fill_box(x0 - 0.05, y0 - 0.05, x1 + 0.05, y1, trim * 0.95, 0.02)
        mid = (x0 + x1) / 2
        if opening.floor > 0:
            canvas.add_moulding(x0 - 0.22, y0 - 0.30, x1 + 0.22, y0 - 0.16, trim, (0.17, 0.17, 0.12, 0.05))
            canvas.fill_polygon(
                [(mid - 0.14, y0 - 0.32), (mid + 0.14, y0 - 0.32), (mid + 0.08, y0), (mid - 0.08, y0)], trim, 0.13
            )
        paint_sill(canvas, box, trim, out=0.14)


def paint_sill(canvas: Canvas, box: Box, colour: Float32Array, *, out: float) -> None:
    """Paint a window sill.

    Parameters
    ----------
    canvas : changed in place.
    box : x0, y0, x1, y1 of the window in metres.
    colour : (3,) linear light.
    out : metres that the sill projects to either side.
    """
    x0, _, x1, y1 = box
    canvas.add_moulding(x0 - out, y1, x1 + out, y1 + 0.11, colour, SILL_PROFILE_M)


def paint_shop_pilasters(canvas: Canvas, plan: FacadePlan, bays: list[Box], palette: FacadePalette) -> None:
    """Paint pilasters with plinths on both sides of shop bays.

    Parameters
    ----------
    canvas : changed in place.
    plan : layout of the facade.
    bays : x0, y0, x1, y1 of each bay in metres.
    palette : colours of the facade.
    """
    if plan.style.base == "tile":
        return
    foot = plan.lines[0] * plan.metres_per_pixel
    for x0, y0, x1, _ in bays:
        for left, right in ((x0 - 0.24, x0 - 0.03), (x1 + 0.03, x1 + 0.24)):
            canvas.fill_box(left, y0, right, foot - 0.5, palette.base * 1.08, 0.07)
            canvas.add_moulding(left - 0.03, y0, right + 0.03, y0 + 0.16, palette.base * 1.1, (0.13, 0.13, 0.09))
            canvas.fill_box(left - 0.02, foot - 0.5, right + 0.02, foot, palette.base * 0.85, 0.1)


def paint_door_surround(canvas: Canvas, plan: FacadePlan, box: Box, palette: FacadePalette) -> None:
    """Paint a door's surround with a hood; stone for the old styles, a thin canopy for the modern one.

    Parameters
    ----------
    canvas : changed in place.
    plan : layout of the facade.
    box : x0, y0, x1, y1 of the door in metres.
    palette : colours of the facade.
    """
    x0, y0, x1, y1 = box
    if plan.style.is_modern:
        canvas.fill_box(x0 - 0.08, y0 - 0.08, x1 + 0.08, y1, palette.trim, 0.03)
        canvas.add_moulding(x0 - 0.35, y0 - 0.24, x1 + 0.35, y0 - 0.08, palette.trim * 1.05, (0.85, 0.85, 0.82))
        return
    if plan.style.base == "wall":
        canvas.fill_box(x0 - 0.10, y0 - 0.10, x1 + 0.10, y1, palette.trim, 0.03)
        return
    stone = palette.trim if plan.style.base != "granite" else palette.base * 1.15
    canvas.fill_box(x0 - 0.26, y0 - 0.26, x1 + 0.26, y1, stone, 0.11)
    canvas.fill_box(x0 - 0.09, y0 - 0.09, x1 + 0.09, y1, stone * 0.93, 0.06)
    canvas.add_moulding(x0 - 0.38, y0 - 0.42, x1 + 0.38, y0 - 0.24, stone, (0.32, 0.32, 0.24, 0.14, 0.1))
    mid = (x0 + x1) / 2
    canvas.fill_polygon(
        [(mid - 0.15, y0 - 0.36), (mid + 0.15, y0 - 0.36), (mid + 0.09, y0), (mid - 0.09, y0)], stone * 1.05, 0.2
    )


def _paint_dormer(canvas: Canvas, box: Box, palette: FacadePalette) -> None:
    x0, y0, x1, y1 = box
    trim, mid = palette.trim, (x0 + x1) / 2
    canvas.fill_box(x0 - 0.17, y0 - 0.10, x1 + 0.17, y1 + 0.10, trim, 0.22)
    across = np.linspace(-1, 1, 15)
    bow = [(mid + a * ((x1 - x0) / 2 + 0.30), y0 - 0.08 - 0.30 * np.sqrt(1 - 0.98 * a * a)) for a in across]
    canvas.fill_polygon(bow, palette.roof * 0.85, 0.34)
    inner = [(mid + a * ((x1 - x0) / 2 + 0.12), y0 - 0.08 - 0.17 * np.sqrt(1 - 0.98 * a * a)) for a in across]
    canvas.fill_polygon(inner, trim * 0.95, 0.26)
    canvas.add_moulding(x0 - 0.26, y1, x1 + 0.26, y1 + 0.12, trim, (0.30, 0.30, 0.2))


def _paint_brick_arch(canvas: Canvas, box: Box, brick: Float32Array, trim: Float32Array) -> None:
    """Paint a flat arch of upright bricks, fanned from a keystone."""
    x0, y0, x1, _ = box
    mid, tall = (x0 + x1) / 2, 0.30
    count = max(7, round((x1 - x0) / 0.12)) | 1
    feet = np.linspace(x0 - 0.04, x1 + 0.04, count + 1)
    tops = mid + (feet - mid) * 1.22
    for number in range(count):
        a, b = feet[number] + 0.008, feet[number + 1] - 0.008
        c, d = tops[number + 1] - 0.008, tops[number] + 0.008
        tone = 0.80 + 0.13 * ((number * 5) % 3)
        canvas.fill_polygon([(a, y0), (b, y0), (c, y0 - tall), (d, y0 - tall)], brick * tone, 0.055)
    for x in (x0 - 0.10, mid - 0.11, x1 - 0.12):
        key = x == mid - 0.11
        lift = 0.08 if key else 0.0
        canvas.fill_box(x, y0 - tall - lift, x + 0.22, y0, trim, 0.08 if key else 0.06)


def _paint_pediment(canvas: Canvas, box: Box, trim: Float32Array, *, is_curved: bool) -> None:
    x0, y0, x1, _ = box
    mid, half, foot = (x0 + x1) / 2, (x1 - x0) / 2 + 0.32, y0 - 0.30
    across = np.linspace(-1, 1, 21)
    lift = np.sqrt(np.clip(1 - across**2, 0, 1)) if is_curved else 1 - np.abs(across)
    for scale, relief, tone in ((1.0, 0.22, 1.0), (0.70, 0.07, 0.93)):
        shape = [
            (mid + a * half * scale, foot - 0.06 * (1 - scale) - 0.46 * scale * up)
            for a, up in zip(across, lift, strict=True)
        ]
        canvas.fill_polygon(shape, trim * tone, relief)
    canvas.add_moulding(mid - half, foot - 0.02, mid + half, foot + 0.12, trim, (0.24, 0.24, 0.16, 0.06))
    for x in (x0 - 0.18, x1 + 0.04):
        canvas.add_moulding(x, foot + 0.12, x + 0.14, foot + 0.44, trim, (0.18, 0.16, 0.1, 0.05))


def _paint_voussoirs(canvas: Canvas, box: Box, stone: Float32Array) -> None:
    """Paint wedge stones of a flat arch that continue the rustication."""
    x0, y0, x1, _ = box
    mid = (x0 + x1) / 2
    feet = np.linspace(x0, x1, 6)
    tops = mid + (feet - mid) * 1.55
    for number in range(5):
        lift = 0.52 if number == 2 else 0.42
        a, b, c, d = feet[number], feet[number + 1], tops[number + 1], tops[number]
        shape = [(a + 0.015, y0), (b - 0.015, y0), (c - 0.02, y0 - lift), (d + 0.02, y0 - lift)]
        canvas.fill_polygon(shape, stone * (1.04 if number % 2 else 0.98), 0.10 if number == 2 else 0.075)
    paint_sill(canvas, box, stone * 1.05, out=0.12)


def _paint_dentils(canvas: Canvas, y0: float, y1: float, colour: Float32Array, *, pitch: float, relief: float) -> None:
    count = max(3, round(canvas.width_m / pitch))
    for x in (np.arange(count) + 0.5) * canvas.width_m / count:
        canvas.fill_box(x - 0.25 * pitch, y0, x + 0.25 * pitch, y1, colour, relief)


def _paint_corbels(canvas: Canvas, y0: float, y1: float) -> None:
    """Paint brick corbels in two steps that carry the parapet."""
    count = max(4, round(canvas.width_m / 0.5))
    for x in (np.arange(count) + 0.5) * canvas.width_m / count:
        for half, share, relief in ((0.15, 0.55, 0.15), (0.09, 1.0, 0.10)):
            at = canvas.region(x - half, y0, x + half, y0 + share * (y1 - y0))
            canvas.relief[at] = np.maximum(canvas.relief[at], np.float32(relief))


def _paint_panels(canvas: Canvas, plan: FacadePlan, y0: float, y1: float, colour: Float32Array) -> None:
    pitch = plan.pitch * plan.metres_per_pixel
    for x in np.arange(round(canvas.width_m / pitch)) * pitch:
        canvas.fill_box(x + 0.14 * pitch, y0, x + 0.86 * pitch, y1, colour * 0.94, 0.05)


def _paint_garland(canvas: Canvas, plan: FacadePlan, y0: float, y1: float, colour: Float32Array) -> None:
    """Paint a frieze of stylised leaves in low relief."""
    count = max(4, round(canvas.width_m / 0.62))
    width, mid = canvas.width_m / count, (y0 + y1) / 2
    turn = np.linspace(0, 2 * np.pi, 25)
    for x in (np.arange(count) + 0.5) * width:
        petal = 0.42 * (y1 - y0) * (0.72 + 0.28 * np.cos(5 * turn))
        canvas.fill_polygon(np.stack([x + petal * np.sin(turn), mid - petal * np.cos(turn)], 1), colour * 0.97, 0.045)
        canvas.fill_box(
            x - 0.46 * width, mid + 0.30 * (y1 - y0), x + 0.46 * width, mid + 0.42 * (y1 - y0), colour, 0.03
        )
