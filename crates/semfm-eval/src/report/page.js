'use strict';
(() => {
  // Tables: a click on a heading sorts by that column, a second one the other way.
  const valueOf = (row, column) => {
    const cell = row.cells[column];
    if (cell.dataset.v !== undefined) return Number(cell.dataset.v);
    const text = cell.textContent.trim();
    return text === '–' ? null : text;
  };
  const compare = (a, b, sign) => {
    if (a === null || b === null) return (a === null) - (b === null); // nothing comes last
    const order = typeof a === 'number' && typeof b === 'number'
      ? a - b : String(a).localeCompare(String(b), undefined, { numeric: true });
    return sign * order;
  };
  const sortTable = (table, column) => {
    const heads = [...table.tHead.rows[0].cells];
    const ascending = heads[column].getAttribute('aria-sort') !== 'ascending';
    heads.forEach((head) => head.removeAttribute('aria-sort'));
    heads[column].setAttribute('aria-sort', ascending ? 'ascending' : 'descending');
    const body = table.tBodies[0];
    const rows = [...body.rows].map((row) => [valueOf(row, column), row]);
    rows.sort((a, b) => compare(a[0], b[0], ascending ? 1 : -1));
    body.append(...rows.map((pair) => pair[1]));
  };
  for (const table of document.querySelectorAll('table.sortable')) {
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      const button = document.createElement('button');
      button.type = 'button';
      button.textContent = head.textContent;
      button.addEventListener('click', () => sortTable(table, column));
      head.replaceChildren(button);
    });
  }

  // Gallery: filters and orders. Without this script all cards stand there, worst first.
  const controls = document.getElementById('controls');
  if (!controls) return;
  const cards = [...document.querySelectorAll('.card')];
  const box = document.getElementById('cards');
  const field = (name) => controls.elements[name];
  const orders = {
    worst: (a, b) => a.dataset.iou - b.dataset.iou,
    best: (a, b) => b.dataset.iou - a.dataset.iou,
    sure: (a, b) => (b.dataset.confidence || -1) - (a.dataset.confidence || -1),
    unsure: (a, b) => (a.dataset.confidence || 2) - (b.dataset.confidence || 2),
    // What was trusted most and deserved it least.
    wrong: (a, b) => (b.dataset.confidence - b.dataset.iou || -9) - (a.dataset.confidence - a.dataset.iou || -9),
    method: (a, b) => a.dataset.rank - b.dataset.rank || a.dataset.iou - b.dataset.iou,
    group: (a, b) => a.dataset.group.localeCompare(b.dataset.group, undefined, { numeric: true }) || a.dataset.iou - b.dataset.iou,
  };
  const update = () => {
    const words = field('words').value.toLowerCase().split(/\s+/).filter(Boolean);
    const fits = (card, key) => !field(key).value || card.dataset[key] === field(key).value;
    let count = 0;
    for (const card of cards) {
      const name = card.dataset.name.toLowerCase();
      card.hidden = !(fits(card, 'method') && fits(card, 'group') && fits(card, 'verdict')
        && words.every((word) => name.includes(word)));
      count += !card.hidden;
    }
    box.append(...cards.sort(orders[field('order').value]));
    field('count').value = `${count} of ${cards.length} shown`;
  };
  controls.hidden = false;
  controls.addEventListener('input', update);
  controls.addEventListener('submit', (event) => event.preventDefault());
  update();
})();
