#!/usr/bin/env python3
"""Runs the cases of tests/vm/cases in the virtual robot, each in a machine of its own; see ./dev vm.

run.py --folder FOLDER --build BUILD [--at-once N] [CASE...]
One line a case; exit status 1 if any failed. FOLDER keeps the machine's image, as long as what it is made from does not
change, and what each case said and wrote.
"""
import argparse
import concurrent.futures
import hashlib
import os
import pathlib
import platform
import re
import shutil
import socket
import subprocess
import sys
import time

import machine

HERE = pathlib.Path(__file__).resolve().parent
CASES = HERE / "cases"
CASE_LIMIT_S = 600  # for one that hangs
SKIPPED = 77
SCENE = "drive?width=320&height=240&focal=250&boxes=2&seed=7&frames=130"
FRAMES = 130


def pack(build, folder):
    """The Debian packages of a robot in folder/this, from the build, and in folder/next what an upgrade would bring: the
    same in a later version, with one line more in the configuration file."""
    shutil.rmtree(folder, ignore_errors=True)
    packed = subprocess.run(["cpack", "--config", build / "CPackConfig.cmake", "-B", folder / "this",
                             "-D", "CPACK_COMPONENTS_ALL=groundline;libcamera"], check=False,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if packed.returncode != 0:
        sys.exit(f"The packages cannot be made: {packed.stdout}")
    shutil.rmtree(folder / "this/_CPack_Packages")
    (folder / "next").mkdir()
    debs = sorted((folder / "this").glob("*.deb"))
    for deb in debs:
        tree = folder / "tree"
        subprocess.run(["dpkg-deb", "-R", deb, tree], check=True)
        control = tree / "DEBIAN/control"
        control.write_text(re.sub(r"(Version: |groundline \(= )(\S+?-)\d+", r"\g<1>\g<2>99", control.read_text()))
        if (config := tree / "etc/groundline/groundline.yaml").exists():
            config.write_text(config.read_text() + "# A line of the next version.\n")
        subprocess.run(["dpkg-deb", "--root-owner-group", "-Znone", "-b", tree, folder / "next" / deb.name], check=True,
                       stdout=subprocess.DEVNULL)
        shutil.rmtree(tree)
    return debs


def needed_packages(debs):
    """What the packages depend on, apart from each other."""
    names = set()
    for deb in debs:
        said = subprocess.run(["dpkg-deb", "-f", deb, "Depends"], capture_output=True, text=True, check=True).stdout
        names.update(wanted.split()[0] for wanted in said.split(","))
    return sorted(names - {"groundline"})


def make_image(folder, packages):
    """The image's folder; made anew when one of the files it is made from, or the list of packages, is another."""
    key = hashlib.sha256(" ".join(packages).encode())
    for file in sorted([HERE / "image.sh", HERE / "vimc_twin.c", *(HERE / "guest").rglob("*")]):
        if file.is_file():
            key.update(file.read_bytes())
    image = folder / f"image-{key.hexdigest()[:12]}"
    if not (image / "made").exists():
        print("The image of the machine is made:", flush=True)
        for old in folder.glob("image-*"):
            shutil.rmtree(old)
        as_root = [] if os.geteuid() == 0 else ["sudo"]
        subprocess.run([*as_root, HERE / "image.sh", image, *packages], check=True)
    return image


def make_shared(shared, programs, frames):
    """What the machine sees as /w beside the packages: the programs, the cases, message types for Python, rendered
    frames."""
    shutil.rmtree(shared / "bin", ignore_errors=True)
    (shared / "bin").mkdir(parents=True, exist_ok=True)
    for program in programs:
        shutil.copy2(program, shared / "bin")
    shutil.rmtree(shared / "vm", ignore_errors=True)
    shutil.copytree(HERE, shared / "vm", ignore=shutil.ignore_patterns("guest", "__pycache__"))
    types = sorted((HERE / "../../include/groundline/lcmtypes").resolve().glob("*.lcm"))
    subprocess.run(["lcm-gen", "--python", "--ppath", shared / "messages", *types], check=True)
    render = hashlib.sha256(frames.read_bytes() + f"{SCENE} {FRAMES}".encode()).hexdigest()
    if not (shared / f"frames/{render}").exists():
        shutil.rmtree(shared / "frames", ignore_errors=True)
        subprocess.run([frames, SCENE, str(FRAMES), shared / "frames"], check=True)
        (shared / f"frames/{render}").touch()
    # The masks of this machine's own processor, for the case that compares them with the emulated one's.
    shutil.rmtree(shared / "replayed", ignore_errors=True)
    subprocess.run([programs[0], "replay", f"synthetic:{SCENE}", "--frames", "2", "--quiet", "--out", shared / "replayed"],
                   check=True)


class Deployment:
    """What the case package_deploy asks the computer outside for."""

    def __init__(self, shared, out):
        self.packages, self.out, self.count = shared / "debs/this", out, 0
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = free.getsockname()[1]

    def offer_key(self):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", self.out / "key"], check=True)

    def deploy(self):
        self.count += 1
        ssh = (f"ssh -p {self.port} -i {self.out}/key -o StrictHostKeyChecking=no -o UserKnownHostsFile=/dev/null "
               "-o LogLevel=ERROR -o BatchMode=yes")
        done = subprocess.run([HERE / "../../dev", "deploy", "root@127.0.0.1"], check=False, text=True,
                              env={**os.environ, "GROUNDLINE_SSH": ssh, "GROUNDLINE_PACKAGES": str(self.packages)},
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        told = self.out / f"deploy-{self.count}"
        told.with_suffix(".part").write_text(f"{done.stdout}\n{done.returncode}")
        told.with_suffix(".part").rename(told)


def run_case(robot, name, shared, out):
    """Status and the case's last line."""
    said = []
    outside = Deployment(shared, out / name)
    with open(out / f"{name}.log", "w", encoding="utf-8") as log:
        def hear(line):
            said.append(line)
            print(line, file=log, flush=True)
            if line == "robot: key":
                outside.offer_key()
            if line == "robot: deploy":
                outside.deploy()

        try:
            status = robot.run(f"PYTHONPATH=/w/vm python3 -u /w/vm/cases/{name}.py", shared, out / name, CASE_LIMIT_S,
                               hear, outside.port)
        except machine.Broken as broken:
            return 1, f"the machine: {broken}"
    last = next((line for line in reversed(said) if line.strip()), "")
    return (1, f"no end within {CASE_LIMIT_S} s; {last}") if status is None else (status, last)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    parser.add_argument("--build", type=pathlib.Path, required=True)
    parser.add_argument("--at-once", type=int, default=1, help="machines that run at one time, each busy on one core or two")
    parser.add_argument("cases", nargs="*")
    wanted = parser.parse_args()
    known = sorted(case.stem for case in CASES.glob("*.py"))
    cases = wanted.cases or known
    if strange := sorted(set(cases) - set(known)):
        sys.exit(f"no such case: {', '.join(strange)}; there are {', '.join(known)}")
    if platform.machine() != "x86_64":
        sys.exit(f"The virtual robot is an amd64 one, this machine is {platform.machine()}: its programs do not run there.")
    folder, build = wanted.folder.resolve(), wanted.build
    out = folder / "cases"
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    programs = [build / "src/cli/groundline", build / "src/daemon/groundlined"]
    programs += (build / "src/daemon").glob("groundline-*.so")  # drivers that are loaded
    debs = pack(build.resolve(), folder / "shared/debs")
    try:
        image = make_image(folder, needed_packages(debs))
    except subprocess.CalledProcessError:
        sys.exit("The image of the virtual robot cannot be made; the lines above say why.")
    shared = folder / "shared"
    make_shared(shared, programs, build / "tests/vm_frames")
    robot = machine.Machine(image)
    try:
        if took_s := robot.prepare():
            print(f"The machine was started and its state saved in {took_s:.0f} s.", flush=True)
    except machine.Broken as broken:
        sys.exit(f"The virtual robot: {broken}")
    counts = {"passed": 0, "skipped": 0, "failed": 0}

    def judge(name):
        begin = time.monotonic()
        status, why = run_case(robot, name, shared, out)
        word = {0: "passed", SKIPPED: "skipped"}.get(status, "failed")
        print(f"{word:8} {name:22} {time.monotonic() - begin:4.0f} s  {why}", flush=True)
        return word

    with concurrent.futures.ThreadPoolExecutor(wanted.at_once) as machines:
        for word in machines.map(judge, cases):
            counts[word] += 1
    print(", ".join(f"{count} {word}" for word, count in counts.items()) + f"; logs are in {wanted.folder / 'cases'}.")
    sys.exit(1 if counts["failed"] else 0)


main()
