"""What several tests share of link modbus."""

from tango_cnc.link.layout import STANDARD


def edited(tmp_path, old, new):
    text = STANDARD.read_text()
    assert old in text
    file = tmp_path / "own.yaml"
    file.write_text(text.replace(old, new))
    return str(file)
