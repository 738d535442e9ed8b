"""Files of other programs for fuzzing: whole ones of each format, damaged ones, and bombs."""

import io
import json
import math
import pickle
import struct
import wave
import zipfile
from pathlib import Path
from random import Random

import ezdxf
import numpy as np
from PIL import Image
from scipy.io import savemat

from tests.soak.fuzz.damage import damaged_bytes, damaged_csv

EXECUTED = "executed"  # the file that a pickle creates if it is executed


class _Executed:
    def __reduce__(self) -> tuple[object, tuple[Path]]:
        return Path.touch, (Path(EXECUTED),)


def scans() -> dict[str, bytes]:
    """Return whole files with scans, by name."""
    angles = range(0, 180, 15)
    rows = [f"{angle},{50 + angle / 4:g}" for angle in angles]
    trace = [f"{k * 1e-5:.6f},{0.1 * math.sin(k):.4f}" for k in range(300)]
    samples = np.sin(np.arange(600.0)).reshape(2, 300)
    return {
        "scan.csv": "\n".join(["angle_deg,range_cm", *rows]).encode(),
        "capture.txt": "\n".join(f"Angle: {a}° Distance: {50 + a} cm" for a in angles).encode(),
        "capture16.txt": "\n".join(f"Angle: {a} Distance: {50 + a} cm" for a in angles).encode("utf-16"),
        "lines.json": "\n".join(json.dumps({"angle": a, "range_cm": 50 + a}) for a in angles).encode(),
        "wide.csv": ("cm," + ",".join(map(str, angles)) + "\n" + ",".join(["0", *map(str, angles)]) + "\n").encode(),
        "topic.csv": b"%time,field.header.frame_id,field.min_range,field.max_range,field.range\n1,a,0.02,4,1.5\n" * 3,
        "carmen.log": b"SONAR 0.2 2 1.0 2.0 0 0 0 0 0 1.57 10.0 host 10.0\n" * 5,
        "player.log": b"10.0 16777343 6665 sonar 00 002 004 02 0 0 0 0 0 0 0 0 0 0 0 1.5\n"
        b"10.1 16777343 6665 sonar 00 002 001 02 1.0 2.0\n" * 3,
        "beesoft.log": b"@SENS 24-11-95 15:02:07.123456\n#SONAR 4: 100.0 120.5 90.0 300.0\n\n#ROBOT 1.0 2.0 90.0\n" * 3,
        "aria.2d": b"LaserOdometryLog\nsick1pose: 10 0 0\nsick1conf: -90 90 3\n"
        + b"time: 1.0\nrobot: 0 0 45\nscan1: 1000 0 0 1500 -900 10\nsick1: 900 800 700\n" * 3,
        "table.csv": b"A title\n\nWinkel;Abstand (cm);t_ms\n" + b"0;50,5;1\n5;;2\n10;-;3\n" * 5,
        "quoted.csv": b'"angle","range, cm"\n' + b'"0","52,5"\n"5",""\n' * 6,
        "scope.csv": "\n".join(
            ["Record Length,Analog:300", "Sample Interval,0.00001", "Second,Value", *trace]
        ).encode(),
        "log.bin": _ping(2300, struct.pack("<BBHHHHHH", 1, 0, 100, 80, 800, 700, 200, 200) + bytes(200)),
        "log1d.bin": _ping(1300, struct.pack("<IHHIIIIH", 1000, 90, 50, 1, 0, 2000, 1, 200) + bytes(200)),
        "trace.wav": _wav(samples),
        "trace.npy": _npy(samples),
        "trace.npz": _npz(samples),
        "trace.mat": _mat(samples),
        "columns.npz": _columns(),
        "columns.npy": _npy(samples.T[:, :2]),
    }


def rooms() -> dict[str, bytes]:
    """Return whole files with rooms, by name; map.pgm belongs to two of them."""
    square = [[0, 0], [3.2, 0], [3.2, 2.4], [0, 2.4], [0, 0]]
    box = (
        "<model name='{0}'><pose>{0} 1 0.5 0 0 0.3</pose><link name='l'><collision name='c'><geometry><box>"
        "<size>2 0.1 1</size></box></geometry></collision></link></model>"
    )
    return {
        "map.yaml": b"image: map.pgm\nresolution: 0.05\norigin: [-1.0, -1.0, 0.1]\noccupied_thresh: 0.65\nnegate: 0\n",
        "room.sdf": ("<sdf version='1.6'><world name='w'>" + box.format(0) + box.format(1) + "</world></sdf>").encode(),
        "stage.world": b'define wall model ( size [2 0.1 1] boundary 1 )\nwall ( name "a" pose [0 0 0 30] '
        b"block ( points 3 point[0] [0 0] point[1] [1 0] point[2] [0 1] z [0 1] ) )\n"
        b'wall ( bitmap "map.pgm" size [4 4 1] )\nposition ( name "r" pose [1 1 0 45] )\n',
        "plan.geojson": json.dumps({"type": "Polygon", "coordinates": [square]}).encode(),
        "plan.svg": b'<svg xmlns="http://www.w3.org/2000/svg" width="320cm" viewBox="0 0 320 240"><defs><g id="a">'
        b'<rect width="40" height="40"/></g></defs><path d="M0 0h320v240h-320z"/><use href="#a" x="9"/>'
        b'<circle cx="99" cy="99" r="9"/><path d="M10 10C20 20 30 0 40 40"/></svg>',
        "plan.dxf": _dxf(),
        "map.pgm": _picture(),
    }


def damaged(chance: Random, whole: dict[str, bytes]) -> tuple[str, dict[str, bytes]]:
    """Return the name of a file to read, and the files: damaged, whole, renamed or a bomb."""
    files = {name: content for name, content in whole.items() if name == "map.pgm"}
    if chance.random() < 0.1:
        name, content = chance.choice([*bombs().items()])
        return name, {**files, name: content}
    name = chance.choice([*whole])
    content = whole[name]
    if chance.random() < 0.85:
        text = chance.random() < 0.5 and content.isascii()
        content = damaged_csv(chance, content.decode()) if text else damaged_bytes(chance, content)
    if files and chance.random() < 0.2:
        files["map.pgm"] = damaged_bytes(chance, files["map.pgm"])
    if chance.random() < 0.15:
        name = chance.choice([*whole])
    return name, {**files, name: content}


def bombs() -> dict[str, bytes]:
    """Return small files that would need much memory or time, or execute something."""
    entities = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 10}">' for k in range(1, 12))
    levels = "".join(f'<g id="g{k}">' + f'<use href="#g{k - 1}"/>' * 10 + "</g>" for k in range(1, 12))
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", bytes(1 << 24))
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (1 << 30, 1 << 10)})
    return {
        "entities.sdf": f'<!DOCTYPE s [<!ENTITY e0 "x">{entities}]><sdf><world>&e11;</world></sdf>'.encode(),
        "entities.svg": f'<!DOCTYPE svg [<!ENTITY e0 "x">{entities}]><svg>&e11;</svg>'.encode(),
        "uses.svg": f'<svg xmlns="http://www.w3.org/2000/svg"><g id="g0"/>{levels}<use href="#g11"/></svg>'.encode(),
        "self.svg": b'<svg><g id="a"><use href="#a"/><rect width="2" height="2"/></g></svg>',
        "deep.sdf": b"<sdf><world>" + b"<model name='m'>" * 3000 + b"</model>" * 3000 + b"</world></sdf>",
        "deep.world": b"model ( " * 3000 + b")" * 3000,
        "deep.geojson": b'{"type":"Polygon","coordinates":' + b"[" * 100_000 + b"]" * 100_000 + b"}",
        "include.world": b'include "include.world"\ninclude "include.world"\n',
        "huge.yaml": b"image: map.pgm\nresolution: 1e-300\norigin: [1e300, nan, inf]\n",
        "huge.sdf": b"<sdf><model name='m'><link><collision><geometry><box><size>1e308 1e308 1</size></box></geometry>"
        b"</collision></link></model></sdf>",
        "zip.npz": packed.getvalue(),
        "shape.npy": header.getvalue(),
        "pickle.npy": _npy(np.array([_Executed()], dtype=object)),
        "pickle.npz": pickle.dumps(_Executed()),
        "pickle.mat": pickle.dumps(_Executed()),
    }


def _ping(kind: int, payload: bytes) -> bytes:
    def text(words: str) -> bytes:
        content = words.encode("utf-16-be")
        return struct.pack(">I", len(content)) + content

    frame = b"BR" + struct.pack("<HHBB", len(payload), kind, 1, 0) + payload
    frame += struct.pack("<H", sum(frame) & 0xFFFF)
    log = text("PingViewer sensor log file") + bytes(4) + text("x") * 5 + bytes(8)
    return log + b"".join(text(f"10:11:{k:02d}.000") + struct.pack(">I", len(frame)) + frame for k in range(5))


def _wav(samples: np.ndarray) -> bytes:
    file = io.BytesIO()
    with wave.open(file, "wb") as sound:
        sound.setnchannels(2)
        sound.setsampwidth(2)
        sound.setframerate(48000)
        sound.writeframes((samples.T * 30000).astype("<i2").tobytes())
    return file.getvalue()


def _npy(samples: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, samples, allow_pickle=True)
    return file.getvalue()


def _npz(samples: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, trace=samples)
    return file.getvalue()


def _columns() -> bytes:
    file = io.BytesIO()
    angles = np.arange(0.0, 180.0, 5.0)
    np.savez_compressed(file, angle_deg=angles, range_m=1 + angles / 200, label=angles.astype(str))
    return file.getvalue()


def _mat(samples: np.ndarray) -> bytes:
    file = io.BytesIO()
    savemat(file, {"trace": samples})
    return file.getvalue()


def _picture() -> bytes:
    cells = np.full((80, 80), 254, np.uint8)
    cells[[0, 1, -2, -1]] = cells[:, [0, 1, -2, -1]] = 0
    cells[30:40, 20:35] = 0
    file = io.BytesIO()
    Image.fromarray(cells).save(file, "PPM")
    return file.getvalue()


def _dxf() -> bytes:
    document = ezdxf.new(setup=False)  # type: ignore[attr-defined]
    document.header["$INSUNITS"] = 6
    space = document.modelspace()
    space.add_lwpolyline([(0, 0), (3.2, 0), (3.2, 2.4), (0, 2.4)], close=True)
    space.add_circle((1, 1), 0.2)
    space.add_arc((2, 1), 0.5, 0, 90)
    document.blocks.new("b").add_line((0, 0), (1, 1))
    space.add_blockref("b", (1, 1))
    text = io.StringIO()
    document.write(text)
    return text.getvalue().encode()
