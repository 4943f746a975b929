'use strict';
(() => {
  // Tables: a click on a heading sorts by that column, a second one the other way.

  /** What a row is sorted by: the number behind a cell, its text, or null for a dash. */
  function sortKey(row, column) {
    const cell = row.cells[column];
    if (cell.dataset.v !== undefined) return Number(cell.dataset.v);
    const text = cell.textContent.trim();
    return text === '–' ? null : text;
  }

  /** Order of two keys, times the sign; null comes last either way. */
  function compareKeys(a, b, sign) {
    if (a === null || b === null) return (a === null) - (b === null);
    if (typeof a === 'number' && typeof b === 'number') return sign * (a - b);
    return sign * compareText(String(a), String(b));
  }

  /** Order of two texts, numbers inside them by value. */
  function compareText(a, b) {
    return a.localeCompare(b, undefined, { numeric: true });
  }

  function sortTable(table, column) {
    const heads = [...table.tHead.rows[0].cells];
    const ascending = heads[column].getAttribute('aria-sort') !== 'ascending';
    heads.forEach((head) => head.removeAttribute('aria-sort'));
    heads[column].setAttribute('aria-sort', ascending ? 'ascending' : 'descending');
    const body = table.tBodies[0];
    const rows = [...body.rows].map((row) => ({ row, key: sortKey(row, column) }));
    rows.sort((a, b) => compareKeys(a.key, b.key, ascending ? 1 : -1));
    body.append(...rows.map((entry) => entry.row));
  }

  for (const table of document.querySelectorAll('table.sortable')) {
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      const button = document.createElement('button');
      button.type = 'button';
      button.textContent = head.textContent;
      button.addEventListener('click', () => sortTable(table, column));
      head.replaceChildren(button);
    });
  }

  // Gallery: filters and orders. Without this script all cards are shown, worst first.
  const controls = document.getElementById('controls');
  if (!controls) return;
  const cards = [...document.querySelectorAll('.card')];
  const box = document.getElementById('cards');

  /** The form's element of this name. */
  function field(name) {
    return controls.elements[name];
  }

  /** Lower IoU first. */
  function byIou(a, b) {
    return a.dataset.iou - b.dataset.iou;
  }

  /** The confidence of a card; `missing` where the method states none. */
  function confidence(card, missing) {
    return card.dataset.confidence || missing;
  }

  /** By how much confidence exceeds IoU; −9 where they are equal. */
  function overconfidence(card) {
    return card.dataset.confidence - card.dataset.iou || -9;
  }

  const orders = {
    worst: byIou,
    best: (a, b) => byIou(b, a),
    sure: (a, b) => confidence(b, -1) - confidence(a, -1),
    unsure: (a, b) => confidence(a, 2) - confidence(b, 2),
    wrong: (a, b) => overconfidence(b) - overconfidence(a),
    method: (a, b) => a.dataset.rank - b.dataset.rank || byIou(a, b),
    group: (a, b) => compareText(a.dataset.group, b.dataset.group) || byIou(a, b),
  };

  /** Whether a card is what the list of this name selects. */
  function fits(card, name) {
    return !field(name).value || card.dataset[name] === field(name).value;
  }

  function update() {
    const words = field('words').value.toLowerCase().split(/\s+/).filter(Boolean);
    let count = 0;
    for (const card of cards) {
      const name = card.dataset.name.toLowerCase();
      const isShown = ['method', 'group', 'verdict'].every((list) => fits(card, list))
        && words.every((word) => name.includes(word));
      card.hidden = !isShown;
      count += isShown;
    }
    box.append(...cards.sort(orders[field('order').value]));
    field('count').value = `${count} of ${cards.length} shown`;
  }

  controls.hidden = false;
  controls.addEventListener('input', update);
  controls.addEventListener('submit', (event) => event.preventDefault());
  update();
})();
