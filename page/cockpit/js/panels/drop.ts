// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Handling of files that are dropped anywhere on the page. */

/**
 * Accept files that are dropped on the page, so that the browser does not open them.
 * @param zone gets data-over while a drop would be accepted
 * @param taken gets the files
 */
export function acceptDrops(zone: HTMLElement, taken: (files: File[]) => void) {
  const hasFiles = (event: DragEvent) => [...event.dataTransfer?.types ?? []].includes('Files');
  const over = (event: DragEvent) => {
    if (hasFiles(event)) {
      event.preventDefault();
      if (event.dataTransfer !== null) {
        event.dataTransfer.dropEffect = 'copy';
      }
      zone.dataset.over = 'yes';
    }
  };
  const leave = (event: DragEvent) => {
    // Every element fires dragleave; only leaving the page has no related target.
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
