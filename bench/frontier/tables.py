#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Puts the figures of docs/figures/frontier.csv into the tables of docs/performance.md.

usage: tables.py FRONTIER.CSV PERFORMANCE.MD

A table belongs to the kernel whose picture precedes it. Its rows are the contenders in the order of the CSV.
"""
import csv
import os
import re
import sys


def number(text):
    value = float(text)
    if value == 0:
        return "0"
    return f"{value:.2g}" if 1e-3 <= abs(value) < 1 else f"{value:.3g}".replace("e-0", "e-").replace("e+0", "e")


def three_digits(text):
    value = float(text)
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def table(lines):
    rows = {}
    for line in lines:
        row = rows.setdefault((line["method"], line["setting"]), {"time": line["time_ms"], "error": {}, "peer": {}})
        if line["error_unit"]:
            row["error"][line["error_unit"]] = (line["error_max"], line["error_rms"])
        if line["peer"]:
            row["peer"][line["peer"].replace("opencv ", "")] = line["ratio"]
    text = ["| | ms | largest error | RMS | ratio |", "|---|---|---|---|---|"]
    for (method, setting), row in rows.items():
        name = f"**{method}, {setting}**" if method.startswith("npsim") else f"{method}, {setting}"
        largest = "; ".join(f"{number(e[0])} {unit}" for unit, e in row["error"].items() if e[0])
        rms = "; ".join(number(e[1]) for e in row["error"].values() if e[1])
        ratio = "; ".join(f"{three_digits(r)} {peer}" for peer, r in row["peer"].items())
        text.append(f"| {name} | {three_digits(row['time'])} | {largest} | {rms} | {ratio} |")
    return text


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    with open(sys.argv[1], newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    with open(sys.argv[2], encoding="utf-8") as file:
        text = file.read().split("\n")
    result, kernel, inside = [], None, False
    for line in text:
        picture = re.match(r"!\[.*\]\(figures/(\w+)\.svg\)", line)
        if picture:
            kernel = picture.group(1)
        if line.startswith("| | ms |") and kernel:
            inside = True
            result += table([entry for entry in lines if entry["kernel"] == kernel])
        if inside and line.startswith("|"):
            continue
        if inside:
            inside, kernel = False, None
        result.append(line)
    partial = sys.argv[2] + ".partial"
    with open(partial, "w", encoding="utf-8") as file:
        file.write("\n".join(result))
    os.replace(partial, sys.argv[2])


if __name__ == "__main__":
    main()
