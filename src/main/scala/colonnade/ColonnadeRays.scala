package colonnade

import chisel3._
import chisel3.util.Decoupled
import colonnade.axi.{AxiReadPort, AxiWritePort}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Load, RayBatch, RegisterFile, RegisterPort}
import colonnade.memory.DramPort
import colonnade.query.{RayArray, RayPort}

final class ColonnadeRaysIO(config: ColonnadeConfig) extends Bundle {
  private val ids = RayPort.idBits(config.array.columns + 1)

  val register = new RegisterPort(RegisterFile.addressBits(config))
  val load     = Flipped(Decoupled(new Load(config))) // ready while no batch runs

  /** Batches, rays and hits in memory. */
  val read  = new AxiReadPort(ids, RayBatch.bytes)
  val write = new AxiWritePort(ids, RayBatch.bytes)

  /** As of [[ColonnadeIO]]. */
  val memoryHolds = Option.when(config.columnBvhMemory.holdable)(
    Input(UInt((config.array.columns * config.columnBvhMemory.banks).W))
  )
  val memory = config.columnBvhMemory.cache.map(_ => DramPort(config))
  val done   = Output(Bool()) // no batch runs

  /** Pulses: a batch has ended; one was refused, or has failed. */
  val batchDone  = Output(Bool())
  val batchError = Output(Bool())
}

/** A device that answers rays of applications: docs/rays.md. The host loads the records, writes the registers, puts batches
  * into the ring, and moves `rays.tail`.
  */
final class ColonnadeRays(config: ColonnadeConfig) extends Module {
  require(config.frame.rays, "a device for rays needs frame.rays=true")
  val io = IO(new ColonnadeRaysIO(config))

  private val registers = Module(RegisterFile.ofRays(config)).io
  private val array     = Module(new RayArray(config)).io
  registers.register <> io.register
  array.registers  := registers.frame
  array.tail       := registers.commands.get.tail
  array.invalidate := registers.invalidate.getOrElse(false.B)
  array.load :<>= io.load
  io.read :<>= array.read
  io.write :<>= array.write
  array.memoryHolds.zip(io.memoryHolds).foreach { case (to, from) => to := from }
  io.memory.zip(array.memory).foreach { case (to, from) => to :<>= from }
  io.done       := !array.isBusy
  io.batchDone  := array.head =/= RegNext(array.head, 0.U)
  io.batchError := RegNext(array.batchError, false.B)

  // Counters and errors, since the last start
  private val status = registers.device
  private val events = array.events
  status.status.busy := array.isBusy
  status.status.done := io.done
  status.rays.head   := array.head

  private def sum(event: UInt): UInt = {
    val counter = RegInit(0.U(status.counters.cycles.getWidth.W))
    counter := Mux(registers.start, 0.U, counter + RegNext(event, 0.U))
    counter
  }
  private def sticky(event: Bool): Bool = {
    val flag = RegInit(false.B)
    flag := event || (flag && !registers.start)
    flag
  }
  status.counters.cycles        := sum(array.isBusy.asUInt)
  status.counters.rays          := sum(array.raysDone)
  status.counters.raysRefused   := sum(events.map(_.raysRefused.asUInt).reduce(_ +& _))
  status.counters.raysInBox     := sum(events.map(_.raysInBox).reduce(_ +& _))
  status.counters.nodeReads     := sum(events.map(_.nodeReads).reduce(_ +& _))
  status.counters.boxTests      := sum(events.map(_.boxTests).reduce(_ +& _))
  status.counters.triangleTests := sum(events.map(_.triangleTests).reduce(_ +& _))
  status.counters.deepestStack  := RegNext(events.map(_.deepestStack).reduce((a, b) => Mux(a > b, a, b)))
  status.errors.stackOverflow   := sticky(events.map(_.stackOverflow).reduce(_ || _))
  status.errors.illegalRecord   := sticky(events.map(_.illegalRecord).reduce(_ || _))
  status.errors.batch           := sticky(array.batchError)
  status.errors.memory.foreach(_ := sticky(array.memoryError))
}
