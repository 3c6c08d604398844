"""The notebook runs from its first to its last cell: by Jupyter where that is installed, else its cells one after the other."""
import importlib.util
import json
import os
import re
import sys
import unittest
from pathlib import Path

from support import SOURCES, InFolder

NOTEBOOK = Path(__file__).resolve().parents[1] / "examples" / "tile-to-plot.ipynb"


def there(*modules):
    return all(importlib.util.find_spec(module) for module in modules)


@unittest.skipUnless(there("matplotlib"), "matplotlib is not installed")
class Notebook(InFolder):
    def setUp(self):
        super().setUp()
        before = dict(os.environ)
        self.addCleanup(lambda: (os.environ.clear(), os.environ.update(before)))
        os.environ.pop("MPLBACKEND", None)
        os.environ.update(REXTRACT_EXAMPLE=str(SOURCES / "tests" / "data"),
                          PYTHONPATH=os.pathsep.join(path for path in sys.path if path))

    def check(self, printed):
        found = {name: int(n) for name, n in re.findall(r"(NONE|RL): (\d+) of \d+ found", printed)}
        # Of 250; before the original pixels decided, 166 and 175 were found.
        self.assertGreater(found["NONE"], 190)
        self.assertGreater(found["RL"], 190)
        self.assertLess(abs(float(re.search(r"median difference ([-+.\d]+) mag", printed)[1])), 0.1)
        for name in ("restored.png", "found.png"):
            self.assertGreater(os.path.getsize(name), 10000)

    def test_cells(self):
        """As a script, with what they print."""
        import contextlib
        import io
        os.environ["MPLBACKEND"] = "Agg"
        said, names = io.StringIO(), {}
        cells = [cell for cell in json.loads(NOTEBOOK.read_text())["cells"] if cell["cell_type"] == "code"]
        with contextlib.redirect_stdout(said):
            for number, cell in enumerate(cells):
                self.assertEqual(cell["outputs"], [], "the notebook is kept without outputs")
                exec(compile("".join(cell["source"]), f"cell {number}", "exec"), names)
        self.check(said.getvalue())

    @unittest.skipUnless(there("nbconvert", "nbformat", "ipykernel"), "nbconvert and ipykernel are not installed")
    def test_jupyter(self):
        import nbformat
        from nbconvert.preprocessors import ExecutePreprocessor
        notebook = nbformat.read(NOTEBOOK, 4)
        ExecutePreprocessor(timeout=600, kernel_name="python3").preprocess(notebook, {"metadata": {"path": os.getcwd()}})
        outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
        self.check("".join(output.text for output in outputs if output.output_type == "stream" and output.name == "stdout"))
        pictures = [output for output in outputs if "image/png" in output.get("data", {})]
        self.assertEqual(len(pictures), 2)
        keep = os.environ.get("RX_NOTEBOOK_KEEP")
        if keep:
            from nbconvert import HTMLExporter
            Path(keep).write_text(HTMLExporter().from_notebook_node(notebook)[0])


if __name__ == "__main__":
    unittest.main()
