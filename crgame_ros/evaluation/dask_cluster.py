# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The Dask cluster that computes cells: started on this machine, or an existing one elsewhere."""

from collections.abc import Iterator
from contextlib import contextmanager
import logging
import os
from typing import Any

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.paths import extra_install

INSTALL = extra_install('evaluate')
# A cell whose worker was killed this often is probably the cause.
ALLOWED_FAILURES = 5
_CONNECT_S = 8.0
# Module that workers started here load at start.
PRELOAD = 'crgame_ros.evaluation.cell_process'


def require_dask() -> None:
    """
    Check that Dask is installed.

    :raises InputError: if it is not, with the command that installs it.
    """
    try:
        import cryptography  # noqa: F401
        import distributed  # noqa: F401
    except ImportError as error:
        raise InputError(f'needs Dask ({error})', 'crgame evaluate', INSTALL) from error


@contextmanager
def dask_client(scheduler: str | None, workers: int, dashboard: int | None) -> Iterator[Any]:
    """
    Connect to a scheduler, or start one with workers on this machine's loopback.

    What is started here speaks TLS with a certificate made for it: without that, every user of
    this machine could have the workers run any code.

    :param scheduler: address of an existing scheduler; None starts one.
    :param workers: number of worker processes to start, each with one thread.
    :param dashboard: port of Dask's page, on the loopback; None for no page.
    :return: a `distributed.Client`.
    :raises InputError: if the scheduler does not answer.
    :raises CrgameError: if a worker process ended while it started, or a worker cannot compute
        cells.
    """
    require_dask()
    import dask
    from distributed import Client, LocalCluster, Security
    # Suppress the many log lines about workers that end while others work.
    for name in (*logging.root.manager.loggerDict, 'tornado.application', 'asyncio'):
        if name.startswith(('distributed', 'tornado', 'asyncio')):
            logging.getLogger(name).setLevel(logging.CRITICAL)
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(f'no scheduler answers there ({error})', f'--scheduler {scheduler}',
                             'start one with `dask scheduler`, and workers with `dask worker '
                             'ADDRESS --nthreads 1`') from error
        with client:
            _check_workers(client)
            yield client
        return
    settings = {
        'distributed.scheduler.allowed-failures': ALLOWED_FAILURES,
        # Cells have their own processes and memory limit.
        'distributed.worker.memory.terminate': False, 'distributed.worker.memory.pause': False,
        'distributed.worker.memory.target': False, 'distributed.worker.memory.spill': False,
        'distributed.worker.preload': [PRELOAD],
        'distributed.admin.large-graph-warning-threshold': '1 GB'}
    with dask.config.set(settings):
        try:
            cluster = LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, host='127.0.0.1',
                # The scheduler serves its health page in any case: on the loopback, at any port.
                dashboard_address=f'127.0.0.1:{dashboard or 0}', worker_dashboard_address=None,
                scheduler_kwargs={'dashboard': dashboard is not None},
                security=Security.temporary(), silence_logs=logging.CRITICAL, memory_limit=0)
        except (OSError, RuntimeError) as error:
            raise CrgameError(f'the {workers} worker processes did not start ({error}): give the '
                              'command again, with fewer --workers if it happens again') \
                from error
        with cluster, Client(cluster, set_as_default=False) as client:
            _check_workers(client)
            yield client


def default_workers() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0))


def _check_workers(client: Any) -> None:
    """Check that no worker lacks this package."""
    for address, answer in client.run(_version, on_error='return').items():
        if isinstance(answer, BaseException):
            raise CrgameError(f'worker {address} cannot import crgame_ros ({answer}): install '
                              'the same version there')


def _version() -> str:
    from crgame_ros.evaluation.source_digest import engine_digest
    return engine_digest()
