#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""albedo_of_streets.py NPSIM FOLDER [--first 1] [--last 16] [--size 480x270]: albedo estimated from generated streets.

Writes the streets that FOLDER lacks, judges the albedo of each with `npsim evaluate`, and prints one line per street,
their means, and the rank correlation (Spearman) of the cars of all streets by mean albedo. Needs Python alone.
"""
import argparse
import json
import os
import subprocess

GROUPS = ("all", "road", "pavement", "facade", "vehicle", "foliage")


def ranks(values):
    order = sorted(range(len(values)), key=lambda i: values[i])
    out = [0] * len(values)
    for rank, i in enumerate(order):
        out[i] = rank
    return out


def correlation(a, b):
    n = len(a)
    mean_a, mean_b = sum(a) / n, sum(b) / n
    both = sum((x - mean_a) * (y - mean_b) for x, y in zip(a, b))
    return both / (sum((x - mean_a) ** 2 for x in a) * sum((y - mean_b) ** 2 for y in b)) ** 0.5


def cell(value):
    return "%9s" % "-" if value is None else "%9.2f" % value


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("npsim")
    parser.add_argument("folder")
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--last", type=int, default=16)
    parser.add_argument("--size", default="480x270")
    options = parser.parse_args()
    print("street   sun/shade" + "".join("%9s" % g for g in GROUPS))
    rows, cars = [], []
    for seed in range(options.first, options.last + 1):
        street = os.path.join(options.folder, "street_%d" % seed)
        if not os.path.exists(os.path.join(street, "scene.json")):
            subprocess.run([options.npsim, "street", street, "--seed", str(seed), "--size", options.size, "--quiet"],
                           check=True)
        report = os.path.join(options.folder, "albedo_%d.json" % seed)
        subprocess.run([options.npsim, "evaluate", street, "-o", report, "--quiet"], check=True,
                       stdout=subprocess.DEVNULL)
        with open(report) as file:
            albedo = json.load(file)["albedo"]
        row = [albedo["sunlit_over_shadowed_asphalt"]] + [albedo["groups"][g]["mean_abs_log2"] for g in GROUPS]
        rows.append(row)
        cars += [(c["truth"], c["estimate"]) for c in albedo["cars"]]
        print("%-9d" % seed + "".join(cell(v) for v in row))
    known = [[v for v in column if v is not None] for column in zip(*rows)]
    print("mean     " + "".join(cell(sum(v) / len(v) if v else None) for v in known))
    if len(cars) > 2:
        print("rank correlation of %d cars: %.2f" % (len(cars), correlation(*map(ranks, zip(*cars)))))


if __name__ == "__main__":
    main()
