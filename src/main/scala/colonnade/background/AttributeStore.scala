package colonnade.background

import chisel3._
import chisel3.util.{log2Ceil, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{AttributeMemories, AttributeMemory, Load}

/** Ports of [[AttributeStore]]. */
final class AttributeStoreIO(config: ColonnadeConfig, memory: AttributeMemory) extends Bundle {

  /** Only while no frame runs. */
  val load = Flipped(Valid(new Load(config)))
  val read = Flipped(Valid(UInt(log2Ceil(memory.depth).W)))

  /** What was read in the cycle before. */
  val word = Output(UInt(memory.bits.W))
}

/** One of the [[AttributeMemories]]. It has a single port, for reads and loads exclude each other. */
final class AttributeStore(config: ColonnadeConfig, memory: AttributeMemory) extends Module {
  val io = IO(new AttributeStoreIO(config, memory))

  private val words  = SyncReadMem(memory.depth, UInt(memory.bits.W))
  private val writes = io.load.valid && io.load.bits.target === memory.target.U
  assert(!(writes && io.read.valid), "a load during a read")

  private val place   = io.load.bits.address(log2Ceil(memory.depth) - 1, 0)
  private val address = Mux(writes, place, io.read.bits)
  io.word := words.readWrite(address, io.load.bits.record(memory.bits - 1, 0), writes || io.read.valid, writes)
}

object AttributeStore {

  /** The one of the given name, which loads fill. */
  def apply(config: ColonnadeConfig, name: String, load: Valid[Load]): AttributeStoreIO = {
    val memory = AttributeMemories(config).find(_.name == name)
    val store  = Module(new AttributeStore(config, memory.getOrElse(throw new NoSuchElementException(name))))
    store.suggestName(name.replace('.', '_'))
    store.io.load := load
    store.io
  }
}
