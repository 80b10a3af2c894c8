#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""depth_by_source.py NPSIM FOLDER [--first 1] [--last 8] [--size 480x270] [--sources network,...]: refined depth of
generated streets, by what measured it. Sources: network (with normals), network-alone (without), stereo, lidar.

Writes the streets that FOLDER lacks, judges the depth of each with `npsim evaluate --depth-only`, and prints one line
per source and street, and the means of each source: mean relative error at pixels without input over that of linear
interpolation of 1/z, the same at pixels with input over that of the input, and the mean angle in degrees between the
normals that light falls on and the true ones, of facades and of vehicles: everywhere, and where the surface is smooth
at the picture's resolution. Needs Python alone.
"""
import argparse
import json
import os
import subprocess

COLUMNS = ("missing", "linear", "/linear", "given", "input", "/input", "facades", "smooth", "vehicles", "smooth")


def cell(value):
    return "%9s" % "-" if value is None else "%9.3f" % value


def figures(report):
    steps = {step["step"]: step for step in report["coverage"]["steps"]}
    last = report["coverage"]["steps"][-1]
    normals = report["coverage"]["normals"]["guiding"]
    missing, given = last["missing"]["all"], last["given"]["all"]
    return [missing["mean"], steps["linear"]["missing"]["all"]["mean"], missing["ratio_to_linear"],
            given["mean"], steps["given"]["given"]["all"]["mean"], given["ratio_to_given"]] + [
                normals.get(group, {}).get(part, {}).get("mean_deg")
                for group in ("facades", "vehicles") for part in ("all", "smooth")]


def leave_out_normals(path):
    with open(path) as file:
        scene = json.load(file)
    scene.pop("normals", None)
    with open(path, "w") as file:
        json.dump(scene, file, indent=1)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("npsim")
    parser.add_argument("folder")
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--last", type=int, default=8)
    parser.add_argument("--size", default="480x270")
    parser.add_argument("--sources", default="network,network-alone,stereo,lidar")
    options = parser.parse_args()
    os.makedirs(options.folder, exist_ok=True)
    print("source        street" + "".join("%9s" % c for c in COLUMNS))
    for source in options.sources.split(","):
        rows = []
        for seed in range(options.first, options.last + 1):
            street = os.path.join(options.folder, "%s_%d" % (source, seed))
            if not os.path.exists(os.path.join(street, "scene.json")):
                depth = source.replace("-alone", "")
                subprocess.run([options.npsim, "street", street, "--seed", str(seed), "--size", options.size, "--depth",
                                depth, "--quiet"], check=True, stdout=subprocess.DEVNULL)
                if depth != source:
                    leave_out_normals(os.path.join(street, "scene.json"))
            path = os.path.join(options.folder, "%s_%d.json" % (source, seed))
            subprocess.run([options.npsim, "evaluate", street, "-o", path, "--depth-only", "--quiet"], check=True,
                           stdout=subprocess.DEVNULL)
            with open(path) as file:
                rows.append(figures(json.load(file)))
            print("%-13s %6d" % (source, seed) + "".join(cell(v) for v in rows[-1]), flush=True)
        known = [[v for v in column if v is not None] for column in zip(*rows)]
        print("%-13s %6s" % (source, "mean") + "".join(cell(sum(v) / len(v) if v else None) for v in known), flush=True)


if __name__ == "__main__":
    main()
