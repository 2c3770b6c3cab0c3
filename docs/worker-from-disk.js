// No browser lets a page that is opened from disk start a worker, in which the search runs: here
// the worker's script runs in a frame of the page. Messages go as between a page and a worker:
// copied, and never before the one who sends them is done.
if (location.protocol === "file:") {
  window.Worker = class {
    constructor(url) {
      this.onmessage = null;
      this.onerror = null;
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      document.body.append(this.frame);

      const inside = this.frame.contentWindow;
      inside.postMessage = (data) => this.answer(data);
      const script = inside.document.createElement("script");
      script.src = url;
      this.started = new Promise((start) => {
        script.onload = start;
        script.onerror = () => this.onerror?.(new ErrorEvent("error", { message: `cannot read ${url}` }));
      });
      inside.document.body.append(script);
    }

    async postMessage(data) {
      const inside = this.frame.contentWindow;
      const copy = inside.structuredClone(data);
      await this.started;
      setTimeout(() => inside.dispatchEvent(new inside.MessageEvent("message", { data: copy })));
    }

    answer(data) {
      const copy = structuredClone(data);
      setTimeout(() => this.onmessage?.(new MessageEvent("message", { data: copy })));
    }

    terminate() {
      this.frame.remove();
    }
  };
}
