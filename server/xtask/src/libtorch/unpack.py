"""Unpacks what building and running needs from the wheels: the processor's libraries, the headers
and the licences, in the wheels' own relative layout (the libraries find each other by it).

Arguments: the folder to fill, then the wheels. Prints the size of each library as `<bytes> <path>`.
"""

import pathlib
import shutil
import sys
import zipfile

LIBRARIES = {
    "torch/lib/libtorch_cpu.so",
    "torch/lib/libc10.so",
    "torch/lib/libgomp.so.1",
    # libtorch_cpu.so asks for these two even where there is no graphics card.
    "nvidia/cu13/lib/libcudart.so.13",
    "nvidia/cu13/lib/libcupti.so.13",
}
HEADERS = tuple(f"torch/include/{folder}/" for folder in ("ATen", "c10", "torch", "caffe2"))


def is_kept(name):
    is_licence = ".dist-info/licenses/" in name
    return name in LIBRARIES or name.startswith(HEADERS) or is_licence


def unpack(wheel, folder):
    with zipfile.ZipFile(wheel) as archive:
        for member in archive.infolist():
            if member.is_dir() or not is_kept(member.filename):
                continue
            target = folder / member.filename
            target.parent.mkdir(parents=True, exist_ok=True)
            # Reading to the end checks the member's checksum.
            with archive.open(member) as source, target.open("wb") as sink:
                shutil.copyfileobj(source, sink, 1 << 20)


folder = pathlib.Path(sys.argv[1])
for wheel in sys.argv[2:]:
    unpack(wheel, folder)
for library in sorted(LIBRARIES):
    print((folder / library).stat().st_size, library)
