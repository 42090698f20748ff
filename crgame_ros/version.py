# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The version of the package, which only package.xml states."""

from xml.etree import ElementTree

from crgame_ros.paths import share_directory

__version__ = ElementTree.parse(share_directory() / 'package.xml').findtext('version', '')
