// Which item a pixel's centre sees and how far away: nothing is blended, nothing is cut out.
in float depth_z;

uniform uint item;

layout(location = 0) out float out_depth_z;
layout(location = 1) out uint out_item;

void main() {
    out_depth_z = depth_z;
    out_item = item;
}
