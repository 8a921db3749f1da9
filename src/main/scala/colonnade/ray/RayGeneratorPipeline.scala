package colonnade.ray

import chisel3._
import chisel3.util.RegEnable
import colonnade.config.ColonnadeConfig
import colonnade.numbers.{Fixed, Rounding}

/** What [[RayGenerator]] does, a ray every 2 cycles, with a multiplier and an adder for each component.
  *
  * The front half multiplies by the step in x, then by that in y; the back half adds them up. The shifted camera registers
  * are constant, so they have no registers of their own. Latency: a ray is offered 4 cycles after its pixel was accepted,
  * if none waits before it. Source: docs/numbers.md, section 1.
  */
final class RayGeneratorPipeline(config: ColonnadeConfig) extends RayGeneratorModule(config) {
  private val numbers = config.numbers
  private val scene   = new RayFormats(numbers).scene

  // Control: the front half multiplies by x, then by y; the back half adds the second product, then offers the ray
  private val inFront  = RegInit(false.B)
  private val ofY      = Reg(Bool())
  private val inBack   = RegInit(false.B)
  private val isSummed = Reg(Bool())
  private val leaves   = io.ray.ready && io.ray.valid
  private val moves    = inFront && ofY && (!inBack || leaves)
  private val adds     = inBack && !isSummed

  io.ray.valid      := inBack && isSummed
  io.position.ready := !inFront || moves
  when(inFront && !ofY) { ofY := true.B }
  when(moves) { inFront := false.B }
  when(io.position.fire) {
    inFront := true.B
    ofY     := false.B
  }
  when(adds) { isSummed := true.B }
  when(leaves) { inBack := false.B }
  when(moves) {
    inBack   := true.B
    isSummed := false.B
  }

  // Datapath: the front half is never at its second product while the back half adds
  private val position   = RegEnable(io.position.bits, io.position.fire)
  private val pixel      = RegEnable(position, moves)
  private val coordinate = Mux(ofY, position.y, position.x).zext
  private val multiplies = moves || (inFront && !ofY)
  private val camera     = io.registers.camera

  private def component(axis: Int): SInt = {
    val step = Mux(ofY, camera.stepY.axes(axis), camera.stepX.axes(axis))
    val term = RegEnable(step * coordinate, multiplies)
    val base = RayGenerator.shiftLeft(camera.dir.axes(axis), camera.stepShift, numbers.directionBits)
    // The sums cannot overflow: directionBits holds all three terms.
    val sum = Reg(SInt(numbers.directionBits.W))
    when(moves || adds) { sum := Rounding.narrow(Mux(adds, sum, base) +& term, numbers.directionBits) }
    sum
  }

  io.pixel             := pixel
  io.ray.bits.context  := pixel.context
  io.ray.bits.isShadow := false.B
  (0 until 3).foreach { axis =>
    val origin = RayGenerator.shiftLeft(camera.position.axes(axis), io.registers.unitShift, scene.width)
    io.ray.bits.origin.axes(axis) := Fixed(scene, origin)
    io.ray.bits.dir.axes(axis)    := component(axis)
  }
}
