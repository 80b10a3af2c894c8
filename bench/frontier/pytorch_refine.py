# SPDX-License-Identifier: Apache-2.0
"""The losses of the refinement and Adam in PyTorch on the CPU, on planes that npsim_frontier wrote.

usage: pytorch_refine.py FOLDER WIDTH HEIGHT FX FY CX CY STEPS

FOLDER holds depth.f32, normals.f32 (interleaved) and uncertain.u8. Perspective tangents, lambda (1, 5, 1), the variable
is d / 80. Prints "version, milliseconds per step, loss before the first step, loss after the last one", the time being
the median over the steps after the first two. One thread.
"""
import sys
import time

import numpy as np
import torch

UNIT_M = 80.0
LAMBDA_NORMAL, LAMBDA_CONTINUITY, LAMBDA_DEPTH = 1.0, 5.0, 1.0


def main():
    folder, width, height = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    fx, fy, cx, cy = (float(v) for v in sys.argv[4:8])
    steps = int(sys.argv[8])
    torch.set_num_threads(1)

    def plane(name, dtype, shape):
        return torch.from_numpy(np.fromfile(f"{folder}/{name}", dtype=dtype).reshape(shape).copy())

    start = plane("depth.f32", np.float32, (height, width)) / UNIT_M
    normals = plane("normals.f32", np.float32, (height, width, 3))
    sure = 1.0 - (plane("uncertain.u8", np.uint8, (height, width)) != 0).float()

    # The last row and column have no tangents; all planes are those of the pixels that do.
    normals = torch.nn.functional.normalize(normals[:-1, :-1], dim=2)
    nx, ny, nz = (normals[:, :, i].contiguous() for i in range(3))
    sure = sure[:-1, :-1].contiguous()
    has_normal = ((nx * nx + ny * ny + nz * nz) > 0.5).float()
    count = has_normal.sum()
    a = (torch.arange(width - 1, dtype=torch.float32) + 0.5 - cx).reshape(1, -1)
    b = (torch.arange(height - 1, dtype=torch.float32) + 0.5 - cy).reshape(-1, 1)

    x = start.clone().requires_grad_(True)
    optimizer = torch.optim.Adam([x], lr=1e-4)

    def loss():
        z, right, below = x[:-1, :-1], x[:-1, 1:], x[1:, :-1]
        sx = (right - z) / right
        sy = (below - z) / below
        mx, my, mz = fx * sx, fy * sy, -(1.0 + a * sx + b * sy)
        inverse = torch.rsqrt(mx * mx + my * my + mz * mz)
        normal = (mx * inverse - nx) ** 2 + (my * inverse - ny) ** 2 + (mz * inverse - nz) ** 2
        # The tangents' products with the given normal.
        along_ray = nx * a / fx + ny * b / fy + nz
        tx = nx + fx * along_ray * sx
        ty = ny + fy * along_ray * sy
        continuity = (tx * tx + ty * ty) * sure
        depth = ((x - start) ** 2).mean()
        return (LAMBDA_NORMAL * (normal * has_normal).sum() / count
                + LAMBDA_CONTINUITY * (continuity * has_normal).sum() / count + LAMBDA_DEPTH * depth)

    first = None
    times = []
    for _ in range(steps):
        begin = time.perf_counter()
        optimizer.zero_grad()
        value = loss()
        value.backward()
        optimizer.step()
        times.append(time.perf_counter() - begin)
        first = value.item() if first is None else first
    with torch.no_grad():
        last = loss().item()
    print(torch.__version__, 1000.0 * float(np.median(times[2:])), first, last)


if __name__ == "__main__":
    main()
