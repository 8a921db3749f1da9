package chiseltest.formal.backends.bounded

import firrtl2.PrimOps.{And, Not}
import firrtl2.ir._
import firrtl2.passes.MemPortUtils.memPortField

import scala.collection.mutable

/** Splits a memory's ports that both read and write in two, for the passes that follow know only those: a port reads
  * where it is enabled and does not write.
  */
private[bounded] object MemoryPorts {
  def split(module: DefModule): DefModule = module match {
    case plain: Module =>
      val ports = new MemoryPorts
      val body  = ports.onStatement(plain.body)
      plain.copy(body = Block(body +: ports.connections))
    case other => other
  }
}

private final class MemoryPorts {
  private val memories = mutable.LinkedHashMap.empty[String, DefMemory]
  private val drivers  = mutable.HashMap.empty[(String, String, String), Expression]

  private def reader(port: String): String = s"${port}_reads"
  private def writer(port: String): String = s"${port}_writes"

  def onStatement(statement: Statement): Statement = statement match {
    case memory: DefMemory if memory.readwriters.nonEmpty =>
      memories += memory.name -> memory
      splitMemory(memory)
    case Connect(_, SubField(SubField(Reference(name, _, _, _), port, _, _), field, _, _), driver)
        if isSplit(name, port) =>
      drivers += (name, port, field) -> onExpression(driver)
      EmptyStmt
    case other => other.mapStmt(onStatement).mapExpr(onExpression)
  }

  private def onExpression(expression: Expression): Expression = expression match {
    case SubField(SubField(Reference(name, _, _, _), port, _, _), "rdata", _, _) if isSplit(name, port) =>
      memPortField(splitMemory(memories(name)), reader(port), "data")
    case other => other.mapExpr(onExpression)
  }

  private def isSplit(memory: String, port: String): Boolean = memories.get(memory).exists(_.readwriters.contains(port))

  private def splitMemory(memory: DefMemory): DefMemory = memory.copy(
    readers = memory.readers ++ memory.readwriters.map(reader),
    writers = memory.writers ++ memory.readwriters.map(writer),
    readwriters = Nil
  )

  /** Of the ports that were split; to follow all other statements. */
  def connections: Seq[Statement] =
    for {
      memory         <- memories.values.toSeq
      port           <- memory.readwriters
      (field, value) <- fields(memory, port)
    } yield Connect(NoInfo, field, value)

  private def fields(memory: DefMemory, port: String): Seq[(Expression, Expression)] = {
    def was(field:    String): Expression = drivers((memory.name, port, field))
    def reads(field:  String): Expression = memPortField(splitMemory(memory), reader(port), field)
    def writes(field: String): Expression = memPortField(splitMemory(memory), writer(port), field)
    def bit(operation: PrimOp, operands: Expression*): Expression =
      DoPrim(operation, operands, Seq(), UIntType(IntWidth(1)))
    Seq(
      reads("clk")   -> was("clk"),
      reads("addr")  -> was("addr"),
      reads("en")    -> bit(And, was("en"), bit(Not, was("wmode"))),
      writes("clk")  -> was("clk"),
      writes("addr") -> was("addr"),
      writes("en")   -> bit(And, was("en"), was("wmode")),
      writes("data") -> was("wdata"),
      writes("mask") -> was("wmask")
    )
  }
}
