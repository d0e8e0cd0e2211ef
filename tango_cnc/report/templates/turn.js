(function(){
"use strict";
var box=document.getElementById("turn"),data=JSON.parse(document.getElementById("turn-data").textContent);
var canvas=box.querySelector("canvas"),pen=canvas.getContext&&canvas.getContext("2d");
if(!pen||!data.points.length)return;
box.classList.add("on");
var turn=-0.61,tilt=0.49,which=1,longer=1,zoom=1;
function sorted(v){return v.map(Math.abs).sort(function(a,b){return a-b});}
function draw(){
 var ratio=window.devicePixelRatio||1,w=canvas.clientWidth,h=canvas.clientHeight;
 if(!w)return;
 if(canvas.width!==Math.round(w*ratio)||canvas.height!==Math.round(h*ratio)){canvas.width=Math.round(w*ratio);canvas.height=Math.round(h*ratio);}
 pen.setTransform(ratio,0,0,ratio,0,0);pen.clearRect(0,0,w,h);
 var ct=Math.cos(turn),st=Math.sin(turn),ci=Math.cos(tilt),si=Math.sin(tilt),k=0.62*Math.min(w,h)/data.size*zoom;
 function flat(p){var x=ct*p[0]-st*p[1],y=st*p[0]+ct*p[1];return[w/2+k*x,h/2-k*(si*y+ci*p[2]),ci*y-si*p[2]];}
 var values=data.sets[which].values,many=sorted(values),ref=many[Math.floor(0.98*(many.length-1))]||1e-9;
 var length=0.3*data.size/ref*longer,i,order=[],a,b,p,n,v;
 for(i=0;i<values.length;i++){p=data.points[i];n=data.normals[i];v=values[i]*length;a=flat(p);b=flat([p[0]+n[0]*v,p[1]+n[1]*v,p[2]+n[2]*v]);order.push([a[2],a,b,values[i]]);}
 data.facets.forEach(function(f){var n=f[1],m=Math.abs(n[0])<=Math.abs(n[1])?(Math.abs(n[0])<=Math.abs(n[2])?0:2):(Math.abs(n[1])<=Math.abs(n[2])?1:2);
  var u=m===0?[0,n[2],-n[1]]:m===1?[-n[2],0,n[0]]:[n[1],-n[0],0],l=Math.hypot(u[0],u[1],u[2])||1,s=0.045*data.size/l;u=u.map(function(c){return c*s;});
  var x=[n[1]*u[2]-n[2]*u[1],n[2]*u[0]-n[0]*u[2],n[0]*u[1]-n[1]*u[0]];
  pen.beginPath();[[1,1],[-1,1],[-1,-1],[1,-1]].forEach(function(c,j){var q=flat([f[0][0]+c[0]*u[0]+c[1]*x[0],f[0][1]+c[0]*u[1]+c[1]*x[1],f[0][2]+c[0]*u[2]+c[1]*x[2]]);if(j)pen.lineTo(q[0],q[1]);else pen.moveTo(q[0],q[1]);});
  pen.closePath();pen.fillStyle="rgba(255,255,255,.75)";pen.fill();pen.strokeStyle="#b8c2cc";pen.lineWidth=1;pen.stroke();});
 order.sort(function(x,y){return y[0]-x[0];});
 for(i=0;i<order.length;i++){a=order[i][1];b=order[i][2];pen.fillStyle="#b8c2cc";pen.beginPath();pen.arc(a[0],a[1],1.7,0,7);pen.fill();
  pen.strokeStyle=order[i][3]>0?"#d55e00":"#0072b2";pen.setLineDash(order[i][3]>0?[]:[4,2]);pen.lineWidth=1.3;pen.beginPath();pen.moveTo(a[0],a[1]);pen.lineTo(b[0],b[1]);pen.stroke();}
 pen.setLineDash([]);
 var names=["X","Y","Z"],o=[46,h-58];
 for(i=0;i<3;i++){p=[0,0,0];p[i]=30/k;a=flat(p);pen.strokeStyle="#1f2933";pen.lineWidth=1.4;pen.beginPath();pen.moveTo(o[0],o[1]);pen.lineTo(o[0]+a[0]-w/2,o[1]+a[1]-h/2);pen.stroke();
  pen.fillStyle="#1f2933";pen.font="12px system-ui,sans-serif";pen.fillText(names[i],o[0]+(a[0]-w/2)*1.25-3,o[1]+(a[1]-h/2)*1.25+4);}
 var px=k*length,unit=Math.pow(10,Math.floor(Math.log10(70/px))),size=unit*(70/px/unit>=5?5:70/px/unit>=2?2:1);
 pen.strokeStyle="#1f2933";pen.lineWidth=2;pen.beginPath();pen.moveTo(w-10-size*px,h-36);pen.lineTo(w-10,h-36);pen.moveTo(w-10-size*px,h-40);pen.lineTo(w-10-size*px,h-32);pen.moveTo(w-10,h-40);pen.lineTo(w-10,h-32);pen.stroke();
 pen.fillStyle="#1f2933";pen.textAlign="right";pen.fillText(+size.toPrecision(2)+" "+data.unit,w-16-size*px,h-32);
 pen.fillStyle="#52606d";pen.fillText(data.words.scale.replace("{factor}",(+(length*data.per_mm).toPrecision(2)).toLocaleString("en-US")),w-10,h-12);
 pen.textAlign="left";pen.strokeStyle="#d55e00";pen.lineWidth=2;pen.beginPath();pen.moveTo(w-150,18);pen.lineTo(w-128,18);pen.stroke();pen.fillText(data.words.outside,w-120,22);
 pen.strokeStyle="#0072b2";pen.setLineDash([4,2]);pen.beginPath();pen.moveTo(w-150,36);pen.lineTo(w-128,36);pen.stroke();pen.setLineDash([]);pen.fillText(data.words.inside,w-120,40);
}
var from=null;
canvas.addEventListener("pointerdown",function(e){from=[e.clientX,e.clientY];canvas.setPointerCapture(e.pointerId);});
canvas.addEventListener("pointermove",function(e){if(!from)return;turn-=(e.clientX-from[0])*0.008;tilt=Math.max(-1.57,Math.min(1.57,tilt+(e.clientY-from[1])*0.008));from=[e.clientX,e.clientY];draw();});
canvas.addEventListener("pointerup",function(){from=null;});
canvas.addEventListener("pointercancel",function(){from=null;});
canvas.addEventListener("keydown",function(e){var s=0.12;
 if(e.key==="ArrowLeft")turn+=s;else if(e.key==="ArrowRight")turn-=s;else if(e.key==="ArrowUp")tilt=Math.min(1.57,tilt+s);else if(e.key==="ArrowDown")tilt=Math.max(-1.57,tilt-s);
 else if(e.key==="+"||e.key==="=")zoom*=1.15;else if(e.key==="-")zoom/=1.15;else return;
 e.preventDefault();draw();});
box.querySelectorAll("button").forEach(function(button){button.addEventListener("click",function(){var what=button.dataset.do;
 if(what==="set"){which=+button.dataset.value;box.querySelectorAll("[data-do=set]").forEach(function(o){o.setAttribute("aria-pressed",o===button);});}
 if(what==="longer")longer*=1.5;if(what==="shorter")longer/=1.5;
 if(what==="reset"){turn=0;tilt=0.25;}if(what==="top"){turn=0;tilt=1.57;}draw();});});
window.addEventListener("resize",draw);draw();
})();
