// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Files dropped anywhere on the page. */

/**
 * Take files that are dropped on the page; none of them replaces the page.
 *
 * @param {HTMLElement} zone shows by data-over that a drop will be taken
 * @param {(files: File[]) => void} taken gets the files
 */
export function acceptDrops(zone, taken) {
  /** @param {DragEvent} event */
  const hasFiles = (event) => [...event.dataTransfer?.types ?? []].includes('Files');
  /** @param {DragEvent} event */
  const over = (event) => {
    if (hasFiles(event)) {
      event.preventDefault();
      if (event.dataTransfer !== null) {
        event.dataTransfer.dropEffect = 'copy';
      }
      zone.dataset.over = 'yes';
    }
  };
  /** @param {DragEvent} event */
  const leave = (event) => {
    // Each element tells of leaving it; only leaving the page has nowhere to go.
    if (event.relatedTarget === null) {
      delete zone.dataset.over;
    }
  };
  window.addEventListener('dragenter', over);
  window.addEventListener('dragover', over);
  window.addEventListener('dragleave', leave);
  window.addEventListener('drop', (event) => {
    delete zone.dataset.over;
    if (hasFiles(event)) {
      event.preventDefault();
      taken([...event.dataTransfer?.files ?? []]);
    }
  });
}
