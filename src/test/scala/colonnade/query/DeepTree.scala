package colonnade.query

import colonnade.Packed
import colonnade.config.ColonnadeConfig
import colonnade.formats.{NodeRecord, RecordFormats}

object DeepTree {

  /** Records of a tree without leaves, in whose cube every ray overflows its stack: each box is the whole cube. */
  def records(config: ColonnadeConfig): Seq[BigInt] = {
    val most     = NodeRecord.most
    val levels   = config.columnBvhMemory.stackDepth / (most - 1) + 1
    val exponent = config.numbers.vertexBits - config.numbers.boxBits + 1
    val node     = new Packed(new RecordFormats(config).node)
    val whole    = for (axis <- "xyz"; child <- 0 until most)
      yield s"children[$child].high.$axis" -> (BigInt(1) << (config.numbers.boxBits - 1))
    val corner                        = "xyz".map(axis => s"corner.$axis" -> (BigInt(1) << exponent))
    def parent(first: BigInt): BigInt =
      node.pack((whole ++ corner).toMap ++ Map("first" -> first, "nodes" -> BigInt(most)))
    parent(1) +: (1 to levels).flatMap(level =>
      Seq.fill(most)(if (level == levels) node.pack(Map.empty) else parent(1 + most * level))
    )
  }
}
