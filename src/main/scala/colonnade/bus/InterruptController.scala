package colonnade.bus

import chisel3._

final class InterruptControllerIO(sources: Int) extends Bundle {
  private def bits = UInt(sources.W)

  val events = Input(bits) // pulses of the sources

  /** Writes of the host, 0 without one: status bits to clear, status bits to set. */
  val clear  = Input(bits)
  val test   = Input(bits)
  val enable = Input(bits)
  val status = Output(bits)

  val interrupt = Output(Bool()) // high while an enabled status bit is set
}

/** A level interrupt. A status bit stays until the host clears it; an event in the same cycle wins. */
final class InterruptController(sources: Int) extends Module {
  val io = IO(new InterruptControllerIO(sources))

  private val status = RegInit(0.U(sources.W))
  status       := (status & ~io.clear) | io.events | io.test
  io.status    := status
  io.interrupt := RegNext((status & io.enable).orR, false.B)
}
