// While the root is read: says how far it is, and shows what came when all is there.
const strip = document.getElementById("reading");
const WAIT_MS = 2000;

if (strip) setTimeout(look, WAIT_MS);

async function look() {
  try {
    const { text, fault } = await fetch("/progress").then((answer) => answer.json());
    if (fault || !text) return location.reload();
    strip.textContent = text;
  } catch {
    // The board may be starting again: ask once more.
  }
  setTimeout(look, WAIT_MS);
}
