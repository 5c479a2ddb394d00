"""Print the commands of the README's section "Two commands", one a line, word for word."""

import re
from pathlib import Path

page = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
section = page.split("\n## Two commands\n")[1].split("\n## ")[0]
block = re.search(r"^```sh\n(.*?)^```$", section, re.DOTALL | re.MULTILINE)[1]
print("\n".join(line for line in block.splitlines() if line and not line.startswith("#")))
