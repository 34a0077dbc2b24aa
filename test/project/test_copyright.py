# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0

import pytest

ament_copyright = pytest.importorskip('ament_copyright')
main = pytest.importorskip('ament_copyright.main')
parser = pytest.importorskip('ament_copyright.parser')


@pytest.mark.copyright
@pytest.mark.linter
def test_copyright(monkeypatch):
    licenses = ament_copyright.get_licenses()
    # ament_copyright knows Apache's long header only; the SPDX line says the same.
    short = licenses['apache2']._replace(
        file_headers=['{copyright}\nSPDX-License-Identifier: Apache-2.0']
    )
    licenses['apache2_spdx'] = short
    for module in (main, parser):
        monkeypatch.setattr(module, 'get_licenses', lambda: licenses, raising=False)
    rc = main.main(argv=['.', 'test'])
    assert rc == 0, 'Found errors'
