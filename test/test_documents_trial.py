# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`scripts/try_documents.py`, which tries the commands of the documents."""

import os
from pathlib import Path
import signal
import subprocess
import sys

import pytest

SCRIPT = Path(__file__).resolve().parents[1] / 'scripts' / 'try_documents.py'


def document(folder: Path, command: str) -> Path:
    path = folder / 'page.md'
    path.write_text(f'Text.\n\n```bash\n{command}\n```\n', encoding='utf-8')
    return path


@pytest.mark.parametrize(('command', 'printed', 'code'), [
    ('echo fine', 'next\n', 0), ('false', '1 commands failed\n', 1)])
def test_what_comes_after_the_commands_runs_if_all_work(
        command: str, printed: str, code: int, tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, SCRIPT, document(tmp_path, command), '--then', 'echo',
                           'next'], capture_output=True, text=True, check=False)
    assert done.returncode == code and done.stdout.endswith(printed)


def test_ended_early_it_ends_the_command_that_it_tries(tmp_path: Path) -> None:
    """A run that nobody ends would go on for ever, with all its nodes."""
    note = tmp_path / 'pid'
    os.mkfifo(note)
    trial = subprocess.Popen([sys.executable, SCRIPT, document(
        tmp_path, f'bash -c "echo \\$\\$ > {note}; while sleep 1; do :; done"')])
    tried = int(note.read_text())
    trial.send_signal(signal.SIGTERM)
    assert trial.wait(60) == 128 + signal.SIGTERM
    assert not Path(f'/proc/{tried}').exists()
