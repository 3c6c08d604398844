"""The Python of docs/python.md runs as it is printed there, on the tile of the repository in place of the installed one."""
import re
import unittest

import numpy as np
import rextract

from support import SOURCES, InFolder

PAGE = (SOURCES / "docs" / "python.md").read_text()


class Page(InFolder):
    def test_blocks(self):
        blocks = re.findall(r"^```python\n(.*?)^```$", PAGE, re.M | re.S)
        self.assertEqual(len(blocks), 1)
        names = {}
        for block in blocks:
            tile = "/usr/local/share/rextract/example/sim.fits.fz"
            self.assertIn(tile, block)
            exec(compile(block.replace(tile, str(SOURCES / "tests" / "data" / "sim.fits.fz")), "docs/python.md", "exec"), names)
        self.assertGreater(len(names["bright"]), 50)
        self.assertGreater(names["real"].sum(), 50)
        self.assertEqual(np.asarray(names["sharp"]).shape, names["hdu"].data.shape)
        self.assertIn("RL", names["sharp"].table.meta["RXREST"])

    def test_table(self):
        """What stands in the column of rextract, beside sep and photutils."""
        rows = PAGE.split("## From sep and photutils")[1].split("\n\n")[1].splitlines()[2:]
        cells = [row.split("|")[4] for row in rows]
        calls = [call for cell in cells for call in re.findall(r"`(\w+\(.*?\)[^`]*)`", cell)]
        self.assertGreater(len(calls), 8)
        names = {name: getattr(rextract, name) for name in rextract.__all__}
        names.update(data=self.pixels, value=3)
        for call in calls:
            with self.subTest(call):
                eval(call, names)


if __name__ == "__main__":
    unittest.main()
