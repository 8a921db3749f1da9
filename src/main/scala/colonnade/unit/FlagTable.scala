package colonnade.unit

import chisel3._
import chisel3.util.Valid
import colonnade.common.{Choice, Context}
import colonnade.config.PathConfig

/** Flags of each context, written by one writer and read with choices: registers; or, of many contexts, a memory for each
  * reader, since a choice is then known a cycle before.
  */
private[unit] final class FlagTable(config: PathConfig, flags: UInt) {
  private val contexts  = config.contexts
  private val registers = Option.unless(config.isLarge)(Reg(Vec(contexts, flags)))
  private val written   = Wire(Valid(flags))
  private val writer    = Wire(Context(config))
  registers.foreach(table => when(written.valid) { table(writer) := written.bits })

  /** To be called once. */
  def write(valid: Bool, context: UInt, value: UInt): Unit = {
    written.valid := valid
    written.bits  := value
    writer        := context
  }

  /** The flags of the context that is chosen now. */
  def read(choice: Choice): UInt = registers.map(_(choice.now.bits)).getOrElse {
    val memory = SyncReadMem(contexts, flags)
    when(written.valid) { memory.write(writer, written.bits) }
    memory.read(choice.following.bits, choice.following.valid)
  }
}
