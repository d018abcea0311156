"""
Shifts of a board's dots between a cold and a hot picture
==========================================================

Finds the dots of ``iriftrace part board`` in both pictures with OpenCV, pairs them, and writes the
table that ``iriftrace fit`` and ``iriftrace compare`` read: position in the cold picture and shift
to the hot one, in pixels, (0, 0) the centre of the first pixel. Use it as a program::

    python board_shifts.py cold.png hot.png -o shifts.csv
"""

import argparse

import cv2
import numpy as np
from scipy.spatial import cKDTree


def find_dots(picture):
    """Centres (n, 2), px, and areas (n,), px, of dark dots in a grey picture."""
    grey = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), 0.8)
    low, high = np.percentile(grey, (2, 98))
    # Paper without its dots: they are smaller than this window, which is found in two steps.
    window = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_window(grey, low, high),) * 2)
    paper = cv2.morphologyEx(grey, cv2.MORPH_CLOSE, window)
    dark = paper - grey
    mask = (dark > 0.4 * (paper - low)) & (paper > 0.5 * (low + high))
    count, label, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    if count > 65_000:
        raise SystemExit("More than 65,000 dark spots: the pictures are noisy, or show no board.")
    # Each dot with its blurred rim; the weight of a pixel is how much darker it is than the paper.
    label = cv2.dilate(label.astype(np.uint16), np.ones((5, 5), np.uint8)).ravel()
    row, column = np.divmod(np.arange(label.size), picture.shape[1])
    weight = np.clip(dark, 0, None).ravel()
    total = np.bincount(label, weight, count)[1:]
    centres = np.column_stack([np.bincount(label, weight * x, count)[1:] for x in (column, row)])
    left, top, width, height, area = stats[1:].T
    whole = (left > 2) & (top > 2)
    whole &= (left + width < picture.shape[1] - 2) & (top + height < picture.shape[0] - 2)
    round_ = np.abs(np.log(width / height)) < 0.25
    usual = np.abs(np.log(area / np.median(area[round_ & (area > 8)]))) < 1.0
    good = whole & round_ & usual & (area > 8)
    centres, area = centres[good] / total[good, None], area[good]
    # Next to the part, darker or brighter than the paper, centres are pulled towards it.
    column, row = centres.round().astype(int).T
    edge = cv2.morphologyEx(paper, cv2.MORPH_GRADIENT, window) > 0.2 * paper
    return centres[~edge[row, column]], area[~edge[row, column]]


def _window(grey, low, high):
    """A little more than the width of the dots, px, by their area in a first, global threshold."""
    dark = (grey < 0.5 * (low + high)).astype(np.uint8)
    area = cv2.connectedComponentsWithStats(dark)[2][1:, cv2.CC_STAT_AREA]
    width = 2.0 * np.sqrt(np.median(area[area > 8]) / np.pi)
    return 2 * int(1.3 * width / 2 + 3) + 1


def pair(cold, hot):
    """Positions (n, 2) and shifts (n, 2), px, of dots that both pictures show, each one whole."""
    (places, areas), (hot_places, hot_areas) = cold, hot
    spacing = np.median(cKDTree(places).query(places, 2)[0][:, 1])
    distance, number = cKDTree(hot_places).query(places)
    # A dot that the part hides in one picture has changed its size, or is missing.
    alike = np.abs(hot_areas[number] / areas - 1.0) < 0.08
    alike &= np.abs(areas / _around(places, areas) - 1.0) < 0.08
    good = (distance < 0.4 * spacing) & alike
    return places[good], hot_places[number[good]] - places[good]


def _around(places, areas):
    """Median area of the nine dots around each; larger dots mark the board's middle."""
    return np.median(areas[cKDTree(places).query(places, 9)[1]], axis=1)


def main():
    """Read two pictures and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("cold")
    parser.add_argument("hot")
    parser.add_argument("-o", "--output", default="shifts.csv")
    given = parser.parse_args()
    pictures = [cv2.imread(name, cv2.IMREAD_ANYDEPTH) for name in (given.cold, given.hot)]
    if any(picture is None for picture in pictures):
        raise SystemExit("A picture cannot be read; give two grey pictures of one camera.")
    places, shifts = pair(*map(find_dots, pictures))
    table = np.hstack((places, shifts))
    np.savetxt(given.output, table, delimiter=",", header="u,v,du,dv", comments="", fmt="%.4f")
    print(f"{len(table):,} dots in {given.output}, shift rms {np.sqrt(np.mean(shifts**2)):.3f} px")


if __name__ == "__main__":
    main()
