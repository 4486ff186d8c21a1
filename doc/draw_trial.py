#!/usr/bin/env python3
"""Film a trial of the drink retrieval, and draw the pictures of the documentation from the film.

    python3 doc/draw_trial.py [--seed SEED] [--film FILE] [--to FOLDER]

It writes drink_retrieval.gif, drink_failure.png, drink_recovered.png and drink_handed_over.png. The
trial takes some minutes, on a ROS master of its own. --film draws from a film that is there. Look
at what it has drawn.
"""

import argparse
import os
import subprocess
import sys
import tempfile

import cv2
import numpy as np

DOC = os.path.dirname(os.path.abspath(__file__))
SEED = 37  # somebody moves the drink, PICK_DRINK fails, and the oracle recovers
RECOVERED, HANDED_OVER = 'MOVE_OUT', 'HAND_OVER'  # states that are pictured
FASTER = 3  # times than the film, which is twice as fast as the world
NOISE = 9  # of 255, by how much the film's codec changes a pixel
STILL = 0.001  # of the pixels change at most in an image that stands still
INK, SAME_INK = 180, 25  # of 255: what is no paper, and how much the codec changes it
COLOURS = 96
CLEAR = 255  # in the palette: a pixel stays as it was
MOST_BYTES, MOST_BYTES_MOVING = 200000, 3000000


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        '--seed', type=int, default=SEED, help='of the trial (default: %(default)s)'
    )
    parser.add_argument('--film', help='file of a film of the launch file (default: make one)')
    parser.add_argument('--to', default=os.path.join(DOC, 'images'), help='folder of the pictures')
    options = parser.parse_args()
    if options.film:
        return draw(options.film, options.to)
    with tempfile.TemporaryDirectory() as folder:
        draw(film(options.seed, folder), options.to)


def film(seed, folder):
    """The file of a film of that trial."""
    from smach_oracle.experiment.launching import free_port

    port = str(free_port())
    subprocess.run(
        [
            'roslaunch',
            '-p',
            port,
            'smach_oracle',
            'drink_retrieval.launch',
            'seed:={}'.format(seed),
            'film:=' + folder,
        ],
        check=True,
        env=dict(os.environ, ROS_MASTER_URI='http://localhost:' + port),
    )
    return os.path.join(folder, '{}.mp4'.format(seed))


def draw(path, folder):
    """Draw all pictures from a film.

    :raises AssertionError: where the trial did not go as the pictures tell.
    """
    from smach_oracle.simulation.node.trial_film import FRAMES_S
    from smach_oracle.simulation.pictures.caption import GREEN, RED

    images = images_of(path)
    failed, ended = told_in(images, RED), told_in(images, GREEN)
    assert failed and ended and failed[0] < ended[0], 'no failure, or no success'
    recovered = [index for index in during(images, RECOVERED) if index > failed[0]]
    assert recovered and during(images, HANDED_OVER), 'no recovery, or nothing handed over'
    save(images[failed[0]], folder, 'drink_failure')
    save(images[recovered[len(recovered) // 2]], folder, 'drink_recovered')
    save(images[ended[0]], folder, 'drink_handed_over')
    # a film has no caption until its node hears the machine
    silent = set(during(images, ''))
    begin = next(index for index in range(len(images)) if index not in silent)
    write_gif(shown(images[begin:], FRAMES_S), os.path.join(folder, 'drink_retrieval.gif'))


def images_of(path):
    """(h, w, 3) uint8 RGB each, without the codec's noise where there is one colour."""
    from smach_oracle.simulation.pictures.caption import HEIGHT, PAPER
    from smach_oracle.simulation.pictures.portrait import BACKGROUND

    video, images = cv2.VideoCapture(path), []
    while True:
        there, image = video.read()
        if not there:
            assert images, '{}: no film'.format(path)
            return images
        image = image[..., ::-1].copy()
        for part, colour, noise in (
            (image[:-HEIGHT], BACKGROUND, NOISE),
            (image[-HEIGHT:], PAPER, 3 * NOISE),
        ):
            part[np.abs(part.astype(int) - colour).max(axis=2) < noise] = colour
        images.append(image)


def told_in(images, colour):
    """The numbers of the images whose caption has that colour."""
    from smach_oracle.simulation.pictures.caption import BAR, HEIGHT

    return [
        index
        for index, image in enumerate(images)
        if np.abs(image[-HEIGHT:, : BAR - 2].mean(axis=(0, 1)) - colour).max() < 30
    ]


def during(images, state):
    """The numbers of the images whose caption names that state alone; for '' nothing."""
    from smach_oracle.simulation.pictures.caption import HEIGHT, LEFT, Caption, strip

    drawn = strip(Caption(state), images[0].shape[1])[:, LEFT:].astype(int)

    def is_so(image):
        seen = image[-HEIGHT:, LEFT:]
        ink = (np.minimum(drawn, seen) < INK).any(axis=2)
        return not ink.any() or np.abs(drawn - seen)[ink].mean() < SAME_INK

    return [index for index, image in enumerate(images) if is_so(image)]


def shown(images, frames_s):
    """Images, and for how many s each: one of those that stand still, the first one with a caption,
    and every so many of the others.
    """
    from smach_oracle.simulation.pictures.caption import GREY, HEIGHT

    working = set(told_in(images, GREY))
    frames, moved = [], 0
    for index, image in enumerate(images):
        changed = np.abs(image.astype(int) - frames[-1][0]).max(axis=2) > NOISE if frames else None
        if frames and index not in working and changed.mean() < STILL:
            frames[-1][1] += 1.0 / frames_s
            continue
        moved += 1
        if not frames or changed[-HEIGHT:].mean() > STILL or moved == FASTER:
            frames.append([image, 1.0 / frames_s])
            moved = 0
    return frames


def write_gif(frames, path):
    """Put images into one picture that moves, each shown for its s."""
    from PIL import Image

    from smach_oracle.simulation.pictures.caption import HEIGHT

    colours = palette_of([image for image, _ in frames[::5]])
    palette = Image.new('P', (1, 1))
    palette.putpalette(colours.ravel().tolist())
    pictures, seen = [], None
    for image, _ in frames:
        drawn = np.array(Image.fromarray(image).quantize(palette=palette, dither=0)) % COLOURS
        exact = colours[drawn].astype(int)
        if pictures:
            same = np.abs(image - seen).max(axis=2) < NOISE
            same[-HEIGHT:] = (exact == seen).all(axis=2)[-HEIGHT:]
            drawn[same] = CLEAR
            exact[same] = seen[same]
        seen = exact
        picture = Image.fromarray(drawn, 'P')
        picture.putpalette(palette.getpalette())
        pictures.append(picture)
    pictures[0].save(
        path,
        save_all=True,
        append_images=pictures[1:],
        loop=0,
        optimize=False,
        transparency=CLEAR,
        disposal=1,
        duration=[round(1000 * shown_s) for _, shown_s in frames],
    )
    assert os.path.getsize(path) < MOST_BYTES_MOVING, path


def palette_of(images):
    """(256, 3) uint8 RGB: also the colours of small things, such as a drink."""
    from PIL import Image

    pixels = np.vstack(images).reshape(-1, 3)
    _, cells, counts = np.unique(
        pixels // 8 @ np.array([1, 32, 1024]), return_inverse=True, return_counts=True
    )
    means = np.column_stack([np.bincount(cells, channel) / counts for channel in pixels.T])
    samples = np.repeat(means.round().astype(np.uint8), np.ceil(counts**0.5).astype(int), axis=0)
    made = Image.fromarray(samples[None]).quantize(COLOURS, kmeans=3).getpalette()
    return np.resize(np.array(made[: 3 * COLOURS], np.uint8).reshape(-1, 3), (256, 3))


def save(image, folder, name):
    """Write a picture."""
    path = os.path.join(folder, name + '.png')
    cv2.imwrite(path, image[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert os.path.getsize(path) < MOST_BYTES, path


if __name__ == '__main__':
    sys.exit(main())
