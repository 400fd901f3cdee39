"""COCO and LabelMe annotations of facades."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from facade_core.core.json_types import JsonObject
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES
from facade_core.core.types import Element
from facade_core.export.attribution import Attribution


@dataclass(frozen=True)
class AnnotatedFacade:
    """Rectified facade with its elements.

    Attributes
    ----------
    facade : id of the facade.
    file : file of its picture.
    width, height : size of the picture, pixels.
    metres_per_pixel : size of a pixel.
    elements : elements in pixels, y down.
    """

    facade: str
    file: str
    width: int
    height: int
    metres_per_pixel: float
    elements: Sequence[Element]

    def clip_elements(self) -> list[Element]:
        """Return the elements in the picture, clipped at its border."""
        found = [
            Element(e.label, max(e.x0, 0), max(e.y0, 0), min(e.x1, self.width), min(e.y1, self.height), e.confidence)
            for e in self.elements
        ]
        return [e for e in found if e.width > 0 and e.height > 0]


def coco_document(facades: Sequence[AnnotatedFacade], description: str, attribution: Attribution) -> JsonObject:
    """Build a COCO object detection document; `score` is the confidence of the parser."""
    annotations: list[dict[str, object]] = []
    for image, facade in enumerate(facades, start=1):
        for e in facade.clip_elements():
            corners = (e.x0, e.y0, e.x1, e.y0, e.x1, e.y1, e.x0, e.y1)
            annotations.append(
                {
                    "id": len(annotations) + 1,
                    "image_id": image,
                    "category_id": CLASSES.index(e.label),
                    "bbox": [round(v, 2) for v in (e.x0, e.y0, e.width, e.height)],
                    "area": round(e.width * e.height, 2),
                    "segmentation": [[round(v, 2) for v in corners]],
                    "iscrowd": 0,
                    "score": e.confidence,
                }
            )
    return {
        "info": {
            "description": description,
            "contributor": attribution.line,
            **({"date_created": attribution.production_date} if attribution.production_date else {}),
            "attribution": attribution.to_json(),
        },
        "licenses": [{"id": i, "name": name} for i, name in enumerate(attribution.licences, start=1)],
        "images": [
            {
                "id": i,
                "file_name": f.file,
                "width": f.width,
                "height": f.height,
                "facade": f.facade,
                "metres_per_pixel": f.metres_per_pixel,
            }
            for i, f in enumerate(facades, start=1)
        ],
        "annotations": annotations,
        "categories": [
            {"id": CLASSES.index(name), "name": name, "supercategory": "facade"}
            for name in sorted(ELEMENT_CLASSES, key=CLASSES.index)
        ],
    }


def labelme_document(facade: AnnotatedFacade, attribution: Attribution) -> JsonObject:
    """Build the LabelMe file of one facade; LabelMe keeps the additional keys for facade and attribution."""
    return {
        "version": "5.5.0",
        "flags": {},
        "shapes": [
            {
                "label": e.label,
                "points": [[round(e.x0, 2), round(e.y0, 2)], [round(e.x1, 2), round(e.y1, 2)]],
                "group_id": None,
                "description": "",
                "shape_type": "rectangle",
                "flags": {},
            }
            for e in facade.clip_elements()
        ],
        "imagePath": facade.file,
        "imageData": None,
        "imageHeight": facade.height,
        "imageWidth": facade.width,
        "facade": facade.facade,
        "attribution": attribution.to_json(),
    }
