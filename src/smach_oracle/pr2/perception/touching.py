"""Whether a cluster of points is one thing or several that touch: by a waist, or two colours."""
import numpy as np

from .clusters import Cluster, OrganizedCloud

SLICE = 0.006  # m along the longer side
WAIST = 0.65  # a slice in the middle narrower than this share of both its sides is a waist
# difference of the shares of red, green and blue from which two sides have two colours
CHROMA = 0.06
LEAST_LENGTH = 0.06  # m: shorter things are one


def why_several(cloud: OrganizedCloud, cluster: Cluster) -> str:
    """What shows that this is more than one thing, or ''."""
    box = cluster.box
    if box.wide < LEAST_LENGTH:
        return ''
    along = (cluster.points[:, :2] - box.centre[:2]) @ box.matrix[:2, :2]
    if box.size[1] > box.size[0]:  # round things have no heading, their longer side may be y
        along = along[:, ::-1]
    if _has_waist(along):
        return 'it has a waist'
    colours = cloud.colour[tuple(cluster.pixels.T)].astype(float)
    return 'it has two colours, side by side' if _two_colours(along[:, 0], colours) else ''


def _has_waist(flat: np.ndarray) -> bool:
    """Whether a footprint (n, 2) is narrower somewhere in its middle than on both sides of that."""
    slices = np.floor((flat[:, 0] - flat[:, 0].min()) / SLICE).astype(int)
    widths = np.array([_width(flat[slices == index, 1]) for index in range(slices.max() + 1)])
    quarter = len(widths) // 4
    return any(widths[at] < WAIST * min(widths[:at].max(), widths[at + 1:].max())
               for at in range(max(1, quarter), len(widths) - max(1, quarter)))


def _width(values: np.ndarray) -> float:
    return float(np.diff(np.percentile(values, [4, 96]))[0]) if len(values) > 3 else 0.0


def _two_colours(along: np.ndarray, colours: np.ndarray) -> bool:
    """Whether the two ends of a footprint differ in colour, whatever light falls on them.

    :param along: (n,) place along the length.
    :param colours: (n, 3).
    """
    order = np.argsort(along)
    quarter = max(1, len(order) // 4)
    ends = [colours[order[:quarter]].mean(axis=0), colours[order[-quarter:]].mean(axis=0)]
    shares = [end / max(1.0, end.sum()) for end in ends]
    return float(np.abs(shares[0] - shares[1]).max()) > CHROMA
