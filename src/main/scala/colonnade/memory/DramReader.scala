package colonnade.memory

import chisel3._
import chisel3.util._
import colonnade.axi.{Axi, AxiAddress, AxiReadPort}
import colonnade.common.RoundRobin
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RecordFormats, SceneLines}

/** The AXI4 read port for scenes in DRAM. */
object DramPort {

  /** One read id for each bank of the shared cache. */
  def idBits(config: ColonnadeConfig): Int = log2Ceil(config.columnBvhMemory.banks.max(2))

  def apply(config: ColonnadeConfig): AxiReadPort =
    new AxiReadPort(idBits(config), config.columnBvhMemory.cache.get.busBytes)
}

final class DramReaderIO(config: ColonnadeConfig) extends Bundle {
  private val banks = config.columnBvhMemory.banks

  /** Address of record 0, a multiple of 4 KB; constant while lines are read. */
  val base = Input(UInt(Axi.addressBits.W))

  /** By bank; a bank's lines come in the order of its reads. */
  val reads = Vec(banks, Flipped(Decoupled(UInt(Lines.lineBits(config).W))))
  val lines = Vec(banks, Decoupled(new ReadLine(config)))
  val axi   = DramPort(config)
}

/** Reads lines from DRAM over AXI4: one INCR burst for a line, with its bank as the id.
  *
  * A line begins at a multiple of `SceneLines.pitch`, so no burst crosses 4 KB. A bank gathers one line while
  * another one waits to be taken; until then, further data for the bank must wait, and data of other banks behind them.
  * Over a narrow bus a line comes so slowly that it waits where it was gathered.
  */
final class DramReader(config: ColonnadeConfig) extends Module {
  private val busBytes = config.columnBvhMemory.cache.get.busBytes
  private val beats    = DramReader.beats(config)

  val io = IO(new DramReaderIO(config))

  io.axi.ar :<>= DramReader.addresses(config, io.base, io.reads)

  // Data
  private val data    = io.axi.r.bits
  private val accepts = for ((port, index) <- io.lines.zipWithIndex) yield {
    val isFor    = data.id === index.U
    val isFull   = RegInit(false.B)
    val isError  = Reg(Bool())
    val beat     = RegInit(0.U(log2Ceil(beats.max(2)).W))
    val gathered = Reg(Vec(beats, UInt((8 * busBytes).W)))
    val line     = Wire(Decoupled(new ReadLine(config)))
    val ready    = !isFull || line.ready
    val takes    = io.axi.r.valid && isFor && ready
    when(takes) {
      gathered(beat) := data.data
      isError        := (isError && beat =/= 0.U) || data.resp =/= 0.U
      beat           := Mux(beat === (beats - 1).U, 0.U, beat + 1.U)
    }
    isFull            := (takes && beat === (beats - 1).U) || (isFull && !line.ready)
    line.valid        := isFull
    line.bits.isError := isError
    line.bits.records := gathered.asUInt(Lines.records * new RecordFormats(config).recordBits - 1, 0)
      .asTypeOf(Vec(Lines.records, new RecordFormats(config).record))
      .map(Lines.withParity(config, _))
    port :<>= (if (beats > DramReader.maxBeats) line else Queue(line, 1, pipe = true))
    isFor && ready
  }
  io.axi.r.ready := accepts.reduce(_ || _)
}

private object DramReader {

  /** Bursts for the lines that are read, which their banks request in turn. */
  def addresses(config: ColonnadeConfig, base: UInt, reads: Seq[DecoupledIO[UInt]]): DecoupledIO[AxiAddress] = {
    val arbiter = Module(new RoundRobin(reads.size))
    val address = Wire(Decoupled(new AxiAddress(DramPort.idBits(config))))
    val bank    = OHToUInt(arbiter.io.grant)
    val line    = Mux1H(arbiter.io.grant, reads.map(_.bits))
    arbiter.io.requests := VecInit(reads.map(_.valid)).asUInt
    arbiter.io.isTaken  := address.fire
    reads.zip(arbiter.io.grant.asBools).foreach { case (read, isGranted) => read.ready := isGranted && address.ready }
    address.valid      := arbiter.io.requests.orR
    address.bits.id    := bank
    address.bits.addr  := base + (Lines.numberOf(config, line, bank) << log2Ceil(SceneLines.pitch(config)))
    address.bits.len   := (beats(config) - 1).U
    address.bits.size  := Axi.size(config.columnBvhMemory.cache.get.busBytes)
    address.bits.burst := Axi.incr
    Queue(address, 2)
  }

  /** Beats of a line. */
  def beats(config: ColonnadeConfig): Int = {
    val busBytes = config.columnBvhMemory.cache.get.busBytes
    (SceneLines.bytes(config) + busBytes - 1) / busBytes
  }
  val maxBeats: Int = 16 // beats of a line that waits beside the next one
}
