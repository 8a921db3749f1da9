package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{AttributeMemories, AttributeMemory, Load}

final class AttributeStoreIO(config: ColonnadeConfig, memory: AttributeMemory) extends Bundle {
  val load = Flipped(Valid(new Load(config))) // only while no frame runs
  val read = Flipped(Valid(UInt(log2Ceil(memory.depth).W)))
  val word = Output(UInt(memory.bits.W))      // the word that was read in the cycle before
}

/** One of the `AttributeMemories`. It has a single port, since reads and loads exclude each other. A load beyond its
  * depth is ignored.
  */
final class AttributeStore(config: ColonnadeConfig, memory: AttributeMemory) extends Module {
  val io = IO(new AttributeStoreIO(config, memory))

  private val words  = SyncReadMem(memory.depth, UInt(memory.bits.W))
  private val loads  = io.load.valid && io.load.bits.target === memory.target.U
  private val writes = loads && io.load.bits.address < memory.depth.U
  assert(!(loads && io.read.valid), "a load during a read")

  private val target  = io.load.bits.address(log2Ceil(memory.depth) - 1, 0)
  private val address = Mux(loads, target, io.read.bits)
  io.word := words.readWrite(address, io.load.bits.record(memory.bits - 1, 0), writes || io.read.valid, writes)
}

/** A store that tiles point into, with arbitrary pointers. A word beyond its end is 0.
  *
  * @param name of the memory
  */
final class AttributeHeap(config: ColonnadeConfig, name: String, load: Valid[Load]) {
  private val store    = AttributeStore(config, name, load)
  private val depth    = AttributeStore.memory(config, name).depth
  private val isBeyond = Wire(Bool())

  /** The word that was read in the cycle before, and whether it lies beyond the end, which makes its tile illegal. */
  val isIllegal: Bool = RegNext(isBeyond, false.B)
  val word:      UInt = Mux(isIllegal, 0.U, store.word)

  /** Connects the read port; call it once. */
  def read(valid: Bool, address: UInt): Unit = {
    store.read.valid := valid
    store.read.bits  := address.pad(store.read.bits.getWidth)(store.read.bits.getWidth - 1, 0)
    isBeyond         := valid && address >= depth.U
  }
}

object AttributeStore {

  /** The memory of the given name. */
  def memory(config: ColonnadeConfig, name: String): AttributeMemory =
    AttributeMemories(config).find(_.name == name).getOrElse(throw new NoSuchElementException(name))

  /** A store for the memory of the given name. */
  def apply(config: ColonnadeConfig, name: String, load: Valid[Load]): AttributeStoreIO = {
    val store = Module(new AttributeStore(config, memory(config, name)))
    store.suggestName(name.replace('.', '_'))
    store.io.load := load
    store.io
  }
}
