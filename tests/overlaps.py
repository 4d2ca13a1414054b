"""Find texts of a figure that overlap each other or a panel, or that are cut."""

from itertools import combinations

#: Pixels that two texts may share: rounding of their boxes.
TOLERANCE = 2.0


def boxes(figure):
    """Return the boxes of all texts that are seen, by their text and kind."""
    figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()
    texts = [text for text in (figure._suptitle,) if text is not None]
    for axes in figure.axes:
        texts += [axes.title, axes.xaxis.label, axes.yaxis.label, axes.xaxis.offsetText, axes.yaxis.offsetText]
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            inside = [tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
            texts += [label for tick in inside for label in (tick.label1, tick.label2)]
    texts += [text for legend in figure.legends for text in legend.get_texts()]
    seen = [text for text in texts if text.get_visible() and text.get_text().strip()]
    found = [(text.get_text(), text.get_window_extent(renderer)) for text in seen]
    return found + [("legend", legend.get_window_extent(renderer)) for legend in figure.legends]


def overlap(a, b):
    return min(a.x1, b.x1) - max(a.x0, b.x0) > TOLERANCE and min(a.y1, b.y1) - max(a.y0, b.y0) > TOLERANCE


def problems(figure):
    whole, found = figure.bbox, boxes(figure)
    for text, box in found:
        outside = max(whole.x0 - box.x0, whole.y0 - box.y0, box.x1 - whole.x1, box.y1 - whole.y1)
        if outside > TOLERANCE:
            yield f"{text!r} is cut by {outside:.1f} pixels"
    of_texts = [each for each in found if each[0] != "legend"]
    for (one, a), (other, b) in combinations(of_texts, 2):
        if overlap(a, b):
            yield f"{one!r} overlaps {other!r}"
    panels = [axes.get_window_extent() for axes in figure.axes]
    for text, box in found:
        if any(overlap(box, panel) for panel in panels):
            yield f"{text!r} lies on a panel"
