import sys,tempfile,time,json
from pathlib import Path
sys.path.insert(0,"/tmp/w/wt/page/tests/support")
from browser import browsing
LISTEN="window.complaints=[];addEventListener('error',e=>complaints.push(e.message));addEventListener('unhandledrejection',e=>complaints.push('rej '+e.reason));addEventListener('securitypolicyviolation',e=>complaints.push('csp '+e.violatedDirective+' '+e.blockedURI));for(const k of ['error','warn']){const o=console[k];console[k]=(...w)=>{complaints.push(k+' '+w.join(' '));}}"
with tempfile.TemporaryDirectory() as d, browsing("/usr/bin/chromium","http://127.0.0.1:18080",Path(d)/"p") as page:
    page.call("Page.enable"); page.call("Page.addScriptToEvaluateOnNewDocument",source=LISTEN); page.call("Page.reload"); time.sleep(12)
    print(page.evaluate("complaints.join('\\n')"))
