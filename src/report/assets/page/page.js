'use strict';
// The table of gates, buttons that copy.
(() => {
  // ---- Gates ----

  const SHOWN_AT_FIRST = 12; // besides all that fail
  const table = document.getElementById('gates-table');
  const gates = [...table.querySelectorAll('tbody.gate')];
  const heads = [...table.querySelectorAll('th[data-key]')];
  const select = document.getElementById('sort-by');
  const failingOnly = document.getElementById('failing-only');
  const showAll = document.getElementById('show-all');
  const shown = document.getElementById('gates-shown');
  let isWhole = gates.length <= SHOWN_AT_FIRST + 3;

  const filter = () => {
    let visible = 0;
    for (const gate of table.querySelectorAll('tbody.gate')) {
      const fails = gate.classList.contains('fail');
      const off = failingOnly.checked ? !fails : !isWhole && !fails && visible >= SHOWN_AT_FIRST;
      gate.classList.toggle('off', off);
      if (!off) visible++;
    }
    shown.textContent = `${visible} of ${gates.length} shown`;
    showAll.hidden = isWhole || failingOnly.checked || visible === gates.length;
  };

  const sort = (key, direction) => {
    const isNumber = heads.find((head) => head.dataset.key === key).dataset.type === 'number';
    const compare = (a, b) => {
      const [x, y] = [a.dataset[key], b.dataset[key]];
      // What is undefined stays last in either direction.
      if (x === undefined || y === undefined) return (x === undefined) - (y === undefined);
      return direction * (isNumber ? x - y : x.localeCompare(y));
    };
    gates.sort(compare);
    table.append(...gates);
    for (const head of heads) {
      if (head.dataset.key === key) head.setAttribute('aria-sort', direction > 0 ? 'ascending' : 'descending');
      else head.removeAttribute('aria-sort');
    }
    select.value = key;
    filter();
  };

  for (const head of heads) {
    const button = document.createElement('button');
    button.type = 'button';
    button.textContent = head.textContent;
    head.replaceChildren(button);
    button.addEventListener('click', () => sort(head.dataset.key, head.getAttribute('aria-sort') === 'ascending' ? -1 : 1));
    select.append(new Option(button.textContent, head.dataset.key));
  }
  select.value = 'margin';
  select.addEventListener('change', () => sort(select.value, 1));
  failingOnly.addEventListener('change', filter);
  showAll.addEventListener('click', () => {
    isWhole = true;
    filter();
    failingOnly.focus();
  });
  filter();

  // ---- Copying ----

  const copyByHand = (text) => {
    const area = document.createElement('textarea');
    area.value = text;
    area.className = 'hidden';
    document.body.append(area);
    area.select();
    const done = document.execCommand('copy');
    area.remove();
    return done;
  };
  for (const button of document.querySelectorAll('button.copy')) {
    button.addEventListener('click', async () => {
      let done = false;
      try {
        await navigator.clipboard.writeText(button.dataset.copy);
        done = true;
      } catch {
        done = copyByHand(button.dataset.copy);
        button.focus();
      }
      button.textContent = done ? 'Copied' : 'Select and copy by hand';
      document.getElementById('copied').textContent = button.textContent;
      setTimeout(() => { button.textContent = 'Copy'; }, 2000);
    });
  }

  // Folded sections are open on paper.
  let folded = [];
  addEventListener('beforeprint', () => {
    folded = [...document.querySelectorAll('details:not([open])')];
    for (const details of folded) details.open = true;
  });
  addEventListener('afterprint', () => {
    for (const details of folded) details.open = false;
  });
})();
