"""A recording as one self-contained page: the browser viewer of the installed package, inlined.

Opens from a file, fetches nothing. About 20 MB: the viewer itself, compressed.
"""

import base64
import gzip
from html import escape
from string import Template

PAGE = Template("""<!doctype html>
<html lang="en"><meta charset="utf-8"><title>$title</title>
<style>
html, body { margin: 0; height: 100%; background: #0d1011; color: #ccc; font: 15px sans-serif }
canvas { width: 100%; height: 100%; display: block }
#note { position: fixed; left: 0; right: 0; top: 45%; text-align: center }
</style>
<div id="note">loading $title</div><canvas id="view"></canvas>
<noscript>This page needs JavaScript; open the .rrd file with the Rerun viewer instead.</noscript>
<!-- The viewer inlined below is Rerun $version (MIT or Apache-2.0), https://rerun.io -->
<script>delete WebAssembly.instantiateStreaming;</script>
<script>$script</script>
<script type="text/plain" id="wasm">$wasm</script>
<script type="text/plain" id="rrd">$rrd</script>
<script>
const note = document.getElementById("note");
function bytes(id) {
  return Uint8Array.from(atob(document.getElementById(id).textContent), c => c.charCodeAt(0));
}
async function show() {
  const unpacked = new Blob([bytes("wasm")]).stream().pipeThrough(new DecompressionStream("gzip"));
  await wasm_bindgen({ module_or_path: await new Response(unpacked).arrayBuffer() });
  const viewer = new wasm_bindgen.WebHandle({
    url: [], hide_welcome_screen: true, enable_history: false, notebook: false, persist: false,
  });
  await viewer.start(document.getElementById("view"));
  viewer.open_channel("inline", "recording");
  viewer.send_rrd_to_channel("inline", bytes("rrd"));
  viewer.close_channel("inline");
  note.remove();
  document.body.dataset.state = "ready";
}
show().catch(error => {
  note.textContent = "The viewer did not start: " + error;
  document.body.dataset.state = "failed";
});
</script>
</html>
""")


def page(title: str, rrd: bytes, script: str, binary: bytes, version: str) -> str:
    """The page as text.

    Parameters
    ----------
    title : str
        Of the page.
    rrd : bytes
        Recording.
    script, binary : str, bytes
        JavaScript and WebAssembly of the viewer.
    version : str
        Of the viewer.
    """
    return PAGE.substitute(
        title=escape(title),
        version=version,
        script=script.replace("</script", "<\\/script"),
        wasm=base64.b64encode(gzip.compress(binary, 9, mtime=0)).decode(),
        rrd=base64.b64encode(rrd).decode(),
    )
