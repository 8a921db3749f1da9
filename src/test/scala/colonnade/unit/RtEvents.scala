package colonnade.unit

import chisel3._
import chisel3.util.Valid
import chiseltest._

/** What happens to the controller in one cycle, from outside. */
private class RtEvents {
  var allocate = false
  var leave    = false
  var entered  = Option.empty[Int]
  val ended    = Array.fill(3)(Option.empty[Int])
  var shaded   = Option.empty[(Int, Seq[Boolean])]
  var bounced  = Option.empty[(Int, Boolean)]
  var dropped  = Option.empty[Int]
  var shadow   = false
  var end      = false
  var coloured = Option.empty[Int]

  // Where there is a room
  var passes   = Option.empty[Int]
  var aside    = Option.empty[Int]
  var question = false
  var met      = Option.empty[Int]
  var nothing  = Option.empty[Int]
  var turn     = false

  /** @param other what ports name that say nothing */
  def poke(dut: RtController, allocates: Boolean, leaves: Boolean, isThere: Boolean)(other: => Int): Unit = {
    def name(port: Valid[UInt], context: Option[Int]): Unit = {
      port.valid.poke(context.nonEmpty)
      port.bits.poke(context.getOrElse(other))
    }
    dut.io.allocate.poke(allocates)
    dut.io.leave.poke(leaves)
    dut.io.shadow.ready.poke(shadow)
    dut.io.end.ready.poke(end)
    name(dut.io.entered, entered)
    dut.io.ended.zip(ended).foreach { case (port, context) => name(port, context) }
    dut.io.shaded.valid.poke(shaded.nonEmpty)
    for ((context, needs) <- shaded) {
      dut.io.shaded.bits.context.poke(context)
      dut.io.shaded.bits.needsShadowRays.zip(needs).foreach { case (port, need) => port.poke(need) }
    }
    dut.io.bounced.valid.poke(bounced.nonEmpty)
    for ((context, isTraced) <- bounced) {
      dut.io.bounced.bits.context.poke(context)
      dut.io.bounced.bits.isTraced.poke(isTraced)
    }
    name(dut.io.dropped, dropped)
    name(dut.io.coloured, coloured)
    for (room <- dut.io.room) {
      room.isThere.poke(isThere)
      room.question.ready.poke(question)
      room.turn.ready.poke(turn)
      name(room.passes, passes)
      name(room.aside, aside)
      name(room.met, met)
      name(room.nothing, nothing)
    }
  }
}
