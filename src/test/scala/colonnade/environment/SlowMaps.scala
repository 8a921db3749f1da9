package colonnade.environment

import chisel3._
import chisel3.util.random.LFSR

/** Between one who asks for a room's maps and the maps: takes questions and gives answers later than it could. */
object SlowMaps {

  /** @param asks with one question in flight in each channel at most */
  def connect(asks: AttributePort, knows: AttributePort, isSlow: Bool): Unit = {
    val noise = LFSR(16)
    join(asks.cells, knows.cells, isSlow && noise(0))
    join(asks.planes, knows.planes, isSlow && noise(5))
    join(asks.albedo, knows.albedo, isSlow && noise(9))
    join(asks.normals, knows.normals, isSlow && noise(3))
  }

  private def join[Q <: Data, A <: Data](
      asks:  AttributeChannel[Q, A],
      knows: AttributeChannel[Q, A],
      holds: Bool
  ): Unit = {
    knows.question.valid := asks.question.valid && !holds
    knows.question.bits  := asks.question.bits
    asks.question.ready  := knows.question.ready && !holds

    // An answer waits, for there is one at most
    val waiting = RegInit(false.B)
    val kept    = Reg(chiselTypeOf(knows.answer.bits))
    when(knows.answer.valid)(kept := knows.answer.bits)
    asks.answer.valid := (knows.answer.valid || waiting) && !holds
    asks.answer.bits := Mux(knows.answer.valid, knows.answer.bits, kept)
    waiting := (knows.answer.valid || waiting) && holds
  }
}
