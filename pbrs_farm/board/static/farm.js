// Keeps a farm's page live: the server sends the parts that changed, already escaped.

const live = document.getElementById("live");
if (live) listen();

function listen() {
  const source = new EventSource(live.dataset.events);
  source.addEventListener("open", () => (live.textContent = "live"));
  source.addEventListener("error", () => (live.textContent = "not connected, retrying"));
  source.addEventListener("message", (event) => {
    for (const [id, html] of Object.entries(JSON.parse(event.data))) {
      const element = document.getElementById(id);
      // Keep the selection of a part that the user reads.
      if (element && !isBeingSelected(element)) element.innerHTML = html;
    }
    live.dataset.events_seen = Number(live.dataset.events_seen ?? 0) + 1;
  });
  // A hidden page sends no requests to the farm.
  addEventListener("pagehide", () => source.close());
}

function isBeingSelected(element) {
  const selection = getSelection();
  return selection && !selection.isCollapsed && element.contains(selection.anchorNode);
}
