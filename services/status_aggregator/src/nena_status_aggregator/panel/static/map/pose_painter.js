// Paints a place that is being chosen, and the heading there, if one is wanted.

const LENGTH = 44;
const HEAD = 11;

export function paintPose(context, [x, y], theta, colour) {
  context.save();
  context.translate(x, y);
  context.strokeStyle = context.fillStyle = colour;
  context.lineWidth = 3;
  context.beginPath();
  context.arc(0, 0, 8, 0, 2 * Math.PI);
  context.stroke();
  if (theta !== null) paintArrow(context, theta);
  context.restore();
}

function paintArrow(context, theta) {
  context.rotate(-theta);
  context.beginPath();
  context.moveTo(8, 0);
  context.lineTo(LENGTH - HEAD, 0);
  context.stroke();
  context.beginPath();
  context.moveTo(LENGTH, 0);
  context.lineTo(LENGTH - HEAD - 2, -HEAD / 1.6);
  context.lineTo(LENGTH - HEAD - 2, HEAD / 1.6);
  context.fill();
}
