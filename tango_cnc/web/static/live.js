(function(){
"use strict";
var card=location.hash.length>1&&document.getElementById(decodeURIComponent(location.hash.slice(1))),rest=card&&card.querySelectorAll("details.rest")||[];
for(var i=0;i<rest.length;i++)rest[i].open=true;
var made=document.querySelector(".made"),born=Date.now(),OLD=600000,GONE=15000;
if(made)setInterval(function(){if(Date.now()-born>OLD&&!made.classList.contains("old")){made.classList.add("old");made.textContent+=". "+made.dataset.old;}},5000);
var wall=document.querySelector("[data-again]");
if(wall)setTimeout(function(){if(navigator.onLine!==false)location.reload();},1000*wall.dataset.again);
var box=document.getElementById("step"),where=box&&box.dataset.follow,mine=box&&box.dataset.run;
if(!where)return;
var tag="",pause=2000;
function again(){setTimeout(look,pause);}
function look(){
 fetch(where+location.search,{headers:tag?{"If-None-Match":tag}:{},cache:"no-store",credentials:"same-origin"}).then(function(answer){
  var clock=answer.headers.get("x-made");
  if(made&&clock&&!answer.redirected){born=Date.now();made.classList.remove("old");made.textContent=decodeURIComponent(clock);}
  if(answer.status===304){again();return;}
  if(answer.redirected){location.reload();return;}
  if(!answer.ok)throw answer.status;
  if((answer.headers.get("x-run")||"")!==mine){location.reload();return;}
  tag=answer.headers.get("etag")||"";
  var state=answer.headers.get("x-run-state");
  return answer.text().then(function(text){
   box.innerHTML=text;pause=state==="running"||state==="waiting"?2000:5000;
   again();
  });
 }).catch(function(){
  if(made&&Date.now()-born>GONE&&!made.classList.contains("old")){made.classList.add("old");made.textContent+=". "+made.dataset.gone;}
  pause=Math.min(pause*2,30000);again();});
}
again();
})();
