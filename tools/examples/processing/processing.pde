// Sends a squat to kinespace and shows what it answers.
// First: Sketch > Import Library > Manage Libraries > oscP5, and elsewhere: kinespace live
import netP5.*;
import oscP5.*;

OscP5 osc;
NetAddress kinespace = new NetAddress("127.0.0.1", 9310);
String[] frames;
String label = "";
int next = 0;

void setup() {
  size(640, 240);
  frameRate(30);
  textAlign(CENTER, CENTER);
  textSize(24);
  // A line for each frame: x y z in metres of HDM05's 31 joints. Joints of other names or in another order: send
  // /motion/skeleton with "processing" and the names at the start and every second.
  frames = loadStrings(sketchPath("../squat.txt"));
  // kinespace answers here.
  osc = new OscP5(this, 9311);
}

void draw() {
  OscMessage frame = new OscMessage("/motion/frame");
  frame.add("processing");
  // The time in seconds; 0: when it arrives.
  frame.add(0.0f);
  for (String number : split(frames[next++ % frames.length], ' ')) frame.add(float(number));
  osc.send(frame, kinespace);

  background(20);
  boolean silent = label.isEmpty() && frameCount > 150;
  text(silent ? "no answer yet: does kinespace live run?" : label, width / 2, height / 2);
}

void oscEvent(OscMessage message) {
  // A class, or still, or unknown.
  if (message.checkAddrPattern("/motion/processing/label")) label = message.get(0).stringValue();
}
