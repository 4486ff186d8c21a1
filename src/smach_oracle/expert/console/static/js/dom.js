// Elements made of plain text: whatever a robot says is a text node, never markup.

const SVG = 'http://www.w3.org/2000/svg';
// what steers a terminal, turns the reading direction, or cannot be seen
const UNSEEN = /[\u0000-\u0008\u000b-\u001f\u007f-\u009f\u00ad\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb]/g;

function clean(text) {
  return String(text).replace(UNSEEN, '\ufffd');
}

function fill(element, properties, children) {
  for (const [name, value] of Object.entries(properties || {})) {
    if (value === null || value === undefined || (value === false && !name.startsWith('aria-'))) continue;
    if (name === 'key') element.key = value;
    else if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else if (name.startsWith('--')) element.style.setProperty(name, value);
    else element.setAttribute(name, value === true && !name.startsWith('aria-') ? '' : clean(value)); // aria says true and false
  }
  append(element, children);
  return element;
}

function nodesOf(children) {
  return children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false)
    .map((child) => (child instanceof Node ? child : document.createTextNode(clean(child))));
}

function append(element, children) {
  for (const node of nodesOf(children)) element.append(node);
}

// h('button', {class: 'x', onclick: f, '--hue': 3}, 'text', other elements); `key`: which one it is, for redraw
export function h(tag, properties, ...children) {
  return fill(document.createElement(tag), properties, children);
}

export function s(tag, properties, ...children) {
  return fill(document.createElementNS(SVG, tag), properties, children);
}

export function replace(element, ...children) {
  element.replaceChildren();
  append(element, children);
  return element;
}

// The element's children are these, in this order. Those that stay are not taken out, not even for a moment: that would cost
// them focus and scroll position, and the click that has begun on them.
export function arrange(element, ...children) {
  whenLetGo(element, () => put(element, nodesOf(children)));
}

// As if the element's children were replaced by these, which were made anew; but those that are there become like them, each
// like the one of its kind and `key`. They keep their listeners, which therefore go by the key alone.
export function redraw(element, ...children) {
  whenLetGo(element, () => {
    const before = new Map();
    for (const node of element.childNodes) {
      if (!before.has(nameOf(node))) before.set(nameOf(node), []);
      before.get(nameOf(node)).push(node);
    }
    put(element, nodesOf(children).map((node) => alike((before.get(nameOf(node)) || []).shift(), node)));
  });
}

function put(element, nodes) {
  const wanted = new Set(nodes);
  for (const node of [...element.childNodes]) if (!wanted.has(node)) node.remove();
  let at = element.firstChild;
  for (const node of wanted) {
    if (node.parentNode === element && node.contains(document.activeElement)) { // it keeps the focus; those before it move
      for (let next; at !== node; at = next) {
        next = at.nextSibling;
        element.append(at);
      }
    }
    if (node === at) at = at.nextSibling;
    else element.insertBefore(node, at);
  }
}

function nameOf(node) { return node.nodeName + ' ' + (node.key === undefined ? '' : node.key); }

function alike(old, fresh) {
  if (!old) return fresh;
  if (old.nodeType === Node.TEXT_NODE) {
    if (old.data !== fresh.data) old.data = fresh.data;
    return old;
  }
  for (const { name } of [...old.attributes]) if (!fresh.hasAttribute(name) && name !== 'open') old.removeAttribute(name); // what a person has opened stays so
  for (const { name, value } of fresh.attributes) {
    if (old.getAttribute(name) === value) continue;
    if (name === 'style') old.style.cssText = value; // the page's policy allows no other way
    else old.setAttribute(name, value);
  }
  redraw(old, [...fresh.childNodes]);
  return old;
}

// What is pressed stays under the pointer until it is let go: around it nothing comes or goes meanwhile.
const CLICK_MS = 100; // by then the click of what was let go has come
const PRESSED = 'button, summary, [role="button"], .mark, .event';
const waiting = new Map(); // element -> its newest change
let pressed = null;
let timer = 0;

// Change what is in an element, unless something in it is pressed: then as soon as that is let go.
export function whenLetGo(element, change) {
  waiting.delete(element);
  if (pressed && element.contains(pressed)) waiting.set(element, change);
  else change();
}

function letGo() {
  clearTimeout(timer);
  pressed = null;
  const changes = [...waiting.values()];
  waiting.clear();
  for (const change of changes) change();
}

window.addEventListener('pointerdown', (event) => {
  letGo();
  pressed = event.button || !(event.target instanceof Element) ? null : event.target.closest(PRESSED);
}, true);
window.addEventListener('click', letGo, true);
for (const type of ['pointerup', 'pointercancel']) {
  window.addEventListener(type, () => {
    clearTimeout(timer); // of another finger
    timer = setTimeout(letGo, CLICK_MS);
  }, true);
}
window.addEventListener('blur', letGo);

// Change an element only where its content differs, so that selections and scroll positions stay.
export function setText(element, text) {
  const cleaned = clean(text);
  if (element.textContent !== cleaned) element.textContent = cleaned;
}

export function toast(text, kind) {
  const shown = h('div', { class: 'toast ' + (kind || '') }, text);
  document.getElementById('toasts').append(shown);
  setTimeout(() => shown.remove(), 6000);
}

export function typing(target) {
  return target instanceof HTMLElement && (target.isContentEditable || /^(INPUT|TEXTAREA|SELECT)$/.test(target.tagName));
}
