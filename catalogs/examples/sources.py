"""Public data of the example blocks: address, checksum and licence of each file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from facade_core.core.errors import InputError

EXAMPLE_BLOCKS_FOLDER = Path(__file__).parent / "blocks"
_DELFSHAVEN = "https://3d.bk.tudelft.nl/opendata/cityjson/3dcities/v2.0/"
_AMSTERDAM = "https://raw.githubusercontent.com/Amsterdam/panorama-textures/{commit}/src/input/"
_PANORAMAS = _AMSTERDAM.format(commit="3f5e0d336adf723bab773e0e0ee6f3c2bf548c77")
_MODEL = _AMSTERDAM.format(commit="7109cbe3bab3fec8ddeab1ed9b610b0eb04fbeb9")
_PLATEAU = (
    "https://raw.githubusercontent.com/Synesthesias/libplateau/a0b1ba01e14598bf0871b419b86ccb5b2d460064/data/udx/bldg/"
)
_PLATEAU_PICTURES = {
    "hnap0034.png": "8fa0d814760cecb75840ccdfa29441da3247b71bab1885a23b18b124b10cf02e",
    "hnap0275.jpg": "c099a9ec927927c9810201220c0999a3d76d7d7a87eecfaa68b7b83e0783b773",
    "hnap0276.jpg": "340177f337b913639d442cdb340be384dc144ad0b5321ef5b523be61d32d1e7c",
    "hnap0279.tif": "239fadc750ee95a14ed7dbb9ac56b4001f220441ae7f0ee4ebe194be1010d451",
    "hnap0285.png": "148ed37a652291de632312d7cfcff8455f0dd5b1bc8f17227c91b5c8044aaeb8",
    "hnap0286.jpg": "6ba47bb6efcc18ef1d34a2c31bdfa7c9b122b6c98bb4b8239b24570b9838fe5c",
    "hnap0876.jpg": "ff16f34a31ab879b071c91f9e318701f9156c7fa40adf7cfdf335e13dd0905d9",
    "hnap0878.tif": "b5051c173dd6817208d1522c0fdb510fece084bda0eb716aa31389a5dd36f00c",
}
_AMSTERDAM_PICTURES = {
    "TMX7316010203-000716_pano_0000_001622.jpg": "6739dfa3c5a97f063adc766ae5914ab5d69e847be9ad4ca957df090a15214bd9",
    "TMX7316010203-000724_pano_0000_000057.jpg": "e171043ac480359c3672cffed6edc47bc3243033d84b811917d59bb266d33d98",
    "TMX7316010203-000724_pano_0000_000215.jpg": "3764fa23f24ec21876ec56e4100dfc9cb371fc69a9155c3e0f2511c0f9417095",
    "TMX7316010203-000724_pano_0000_001219.jpg": "62923886071bf270a60c3e84a901756b2f15d05769dae66ead060906bab40706",
}


@dataclass(frozen=True, slots=True)
class ExampleDataFile:
    """Published file: path below the data folder, address and sha256."""

    path: str
    url: str
    sha256: str


@dataclass(frozen=True, slots=True)
class ExampleDataSource:
    """Data that an example block is made from.

    Attributes
    ----------
    licence : words that name the giver and the licence.
    files : files to download.
    companion_files : (path below the data folder, file in `blocks/`) of files that are copied along.
    """

    licence: str
    files: tuple[ExampleDataFile, ...]
    companion_files: tuple[tuple[str, str], ...] = ()


_AMSTERDAM_SOURCE = ExampleDataSource(
    licence="City of Amsterdam open data: panoramas, wall heights and one building model",
    files=(
        ExampleDataFile(
            "city/amsterdam/0363100012143961.obj",
            f"{_MODEL}0363100012143961.obj",
            "7548ecb568e5777e4bfa5e3c8394fa15919fa03ad7110f2d1030edded2c80cc9",
        ),
        *(ExampleDataFile(f"city/amsterdam/panoramas/{n}", _PANORAMAS + n, h) for n, h in _AMSTERDAM_PICTURES.items()),
    ),
    companion_files=(("city/amsterdam/poses_and_walls.json", "amsterdam_poses_and_walls.json"),),
)
EXAMPLE_SOURCES = {
    "amsterdam-dam": _AMSTERDAM_SOURCE,
    "amsterdam-ij": _AMSTERDAM_SOURCE,
    "delfshaven": ExampleDataSource(
        licence="Rotterdam 3D, open data of the city, as CityJSON by the 3D geoinformation group of TU Delft",
        files=(
            ExampleDataFile(
                "city/delfshaven/3-20-DELFSHAVEN.city.json",
                _DELFSHAVEN + "3-20-DELFSHAVEN.city.json",
                "958460c670b4cb85a9159d1e5e566905fba8812864f64b554ecad38333badcf6",
            ),
        ),
    ),
    "plateau": ExampleDataSource(
        licence="Project PLATEAU, Ministry of Land, Infrastructure, Transport and Tourism, Japan: PLATEAU site policy",
        files=(
            ExampleDataFile(
                "city/plateau_textured/53392642_bldg_6697_op2.gml",
                _PLATEAU + "53392642_bldg_6697_op2.gml",
                "9ca9ea0798c0813bfd05525895d779188d5bb7a62f4a1eaae21214ca53f80cd1",
            ),
            *(
                ExampleDataFile(
                    f"city/plateau_textured/53392642_bldg_6697_appearance/{n}",
                    f"{_PLATEAU}53392642_bldg_6697_appearance/{n}",
                    h,
                )
                for n, h in _PLATEAU_PICTURES.items()
            ),
        ),
    ),
}


def download_example_data(source: ExampleDataSource, folder: Path, on_file: Callable[[], None]) -> None:
    """Download a source's files into a folder and verify their checksums; existing files stay.

    Parameters
    ----------
    on_file : called after each file.

    Raises
    ------
    InputError : names the file and its address, if it cannot be downloaded or has changed.
    """
    import pooch
    import requests

    pooch.get_logger().setLevel("ERROR")
    for file in source.files:
        target = folder / file.path
        try:
            pooch.retrieve(file.url, f"sha256:{file.sha256}", fname=target.name, path=target.parent)
        except (requests.RequestException, OSError) as error:
            raise InputError(
                f"{target.name} cannot be fetched from {file.url} ({type(error).__name__}); try again, or put it at {target}"
            ) from error
        except ValueError as error:
            raise InputError(
                f"{target.name} at {file.url} is not the file it was (checksum differs); fetch it by hand if you trust it"
            ) from error
        on_file()
    for path, name in source.companion_files:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes((EXAMPLE_BLOCKS_FOLDER / name).read_bytes())
