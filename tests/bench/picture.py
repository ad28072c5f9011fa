"""The picture of the bench in the README: ``python -m tests.bench.picture``."""

from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

from tests.bench.browsing import FOCUSED, enter, opened, served

PICTURE = Path(__file__).parents[2] / "data" / "figures" / "rehearse.png"
STEPS = 12  # of the book, to the first shot


def main() -> None:
    """Take a day by the book to its third shot and photograph the page."""
    with TemporaryDirectory() as place, served(Path(place) / "day") as (_, address), opened() as b:
        page = b.new_page(viewport={"width": 1280, "height": 770})
        page.goto(address)
        page.wait_for_selector(FOCUSED, state="attached")
        for _ in range(STEPS + 5):  # three shots, two of them decided on
            enter(page)
        page.locator("#cursor").fill("30")
        page.locator("#moment").fill("34")
        page.evaluate("document.activeElement.blur(); scrollTo(0, 0)")
        picture = np.frombuffer(page.screenshot(), dtype=np.uint8)
    pixels = cv2.imdecode(picture, cv2.IMREAD_COLOR)
    cv2.imwrite(str(PICTURE), pixels, [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    main()
